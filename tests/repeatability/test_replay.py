"""Replay tells simulators that repeat themselves from those that do not."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from pytest_simbench.client.errors import Unavailable, Where, WorkerExited
from pytest_simbench.client.tape import Operation
from pytest_simbench.experiment.handle import SimulatorHandle
from pytest_simbench.records.checked import convert
from pytest_simbench.records.repeatability import Again
from pytest_simbench.repeatability.episode import Episode, Episodes
from pytest_simbench.repeatability.motions import difference
from pytest_simbench.repeatability.replay import ANOTHER, Replay, replay
from pytest_simbench.scene import Scene
from pytest_simbench.simulator import Capability
from pytest_simbench.tasks import Moment, Throwing
from tests.repeatability.conftest import first_seed
from tests.repeatability.scripted import ALL, NAMES, moved, operation

EVERYTHING = frozenset(Capability)
PATIENCE = 20.0
"""For what takes milliseconds, on a machine that is busy [s]."""

MOMENTS = (Moment("in flight", "fly"),)
WAYS = (
    "after a reset",
    "after another episode",
    "restored in flight",
    "fresh process",
    "with a window",
)


@pytest.fixture
def replayed(
    tumbling: Callable[..., Episodes], handle_of: Callable[..., SimulatorHandle]
) -> Callable[..., Replay]:
    """Falling cubes, run again in a simulator that claims to be deterministic and to do all."""

    def run(name: str = "mujoco", episodes: Episodes | None = None, **options: Any) -> Replay:
        given = {
            "capabilities": EVERYTHING, "fresh": handle_of(name),
            "other_mode": "no display", "moments": MOMENTS, **options,
        }  # fmt: skip
        return replay(episodes or tumbling(name), **given)

    return run


def broken(result: Replay) -> set[str]:
    return {again.way for again in result.again if again.first is not None}


@pytest.mark.parametrize("name", ["mujoco", "pybullet"])
def test_engines_keep_their_claim(replayed: Callable[..., Replay], name: str) -> None:
    result = replayed(name)
    result.assert_as_claimed()
    assert tuple(again.way for again in result.again) == WAYS
    assert [again.identical for again in result.again] == [True] * 4 + [False]
    assert result.again[-1].text == "no display"


def test_noise_is_found_everywhere_and_grows(replayed: Callable[..., Replay]) -> None:
    result = replayed("Noisy")
    assert broken(result) == set(WAYS[:4])
    first = result.again[0]
    assert first.first == pytest.approx(0.02)  # the first sample
    assert first.growth["1"] is not None
    assert 1e-12 < first.largest < 0.1
    with pytest.raises(AssertionError, match="Noisy claims to be deterministic, but\n.*0.02 s"):
        result.assert_as_claimed()


@pytest.mark.parametrize(
    ("name", "mode", "ways", "told"),
    [
        # memory of earlier worlds
        ("Haunted", None, {WAYS[0], WAYS[1], WAYS[2]}, "after a reset"),
        # half a restore
        ("Forgetful", None, {WAYS[2]}, "restored in flight: first differs at t = 0.07 s"),
        # a restore that only holds for a moment: the world goes on for 0.3 s before it is restored
        ("Stale", None, {WAYS[2]}, "restored in flight: first differs at t = 0.07 s"),
        ("Windowed", "gui", {WAYS[4]}, "with a window"),
    ],
)
def test_what_an_engine_does_not_repeat_is_found(
    replayed: Callable[..., Replay],
    handle_of: Callable[..., SimulatorHandle],
    name: str,
    mode: str | None,
    ways: set[str],
    told: str,
) -> None:
    result = replayed(name, other_mode=handle_of(name, mode) if mode else "no display")
    assert broken(result) == ways
    with pytest.raises(AssertionError, match=told):
        result.assert_as_claimed()


@pytest.mark.parametrize(
    ("name", "unclaimed"),
    [("Noisy", Capability.DETERMINISTIC), ("Forgetful", Capability.EXACT_RESTORE)],
)
def test_what_nobody_claims_is_a_result(
    replayed: Callable[..., Replay], name: str, unclaimed: Capability
) -> None:
    result = replayed(name, capabilities=EVERYTHING - {unclaimed})
    assert "restored in flight" in broken(result)
    result.assert_as_claimed()


def test_failure_to_run_again_is_a_failure_without_a_claim(
    replayed: Callable[..., Replay],
) -> None:
    result = replayed("Refusing", capabilities=EVERYTHING - {Capability.DETERMINISTIC})
    assert [again.failure for again in result.again if again.failure] == [
        "EngineFailed: RuntimeError: no way back"
    ]
    assert result.again[3].identical  # the next one got a fresh worker
    with pytest.raises(AssertionError, match="Refusing could not run again\n.*no way back"):
        result.assert_as_claimed()


def test_what_cannot_be_done_is_told(replayed: Callable[..., Replay]) -> None:
    for options, way, why in (
        ({"capabilities": frozenset()}, "restored in flight", "mujoco cannot save and restore"),
        ({"moments": (Moment("x", "swim"),)}, "restored x", "the task never came to swim"),
        ({"moments": None}, "restored", "the task 'tumbling' declares no moments"),
    ):
        result = replayed(**options)
        result.assert_as_claimed()
        assert (result.again[2].way, result.again[2].text) == (way, why)


def test_a_throw_with_the_cube_in_the_grip_and_after_the_swing(
    replayed: Callable[..., Replay], handle_of: Callable[..., SimulatorHandle]
) -> None:
    episodes = first_seed(handle_of(), replace(Throwing(), settle=0.5), seed=2022)
    result = replayed(episodes=episodes, moments=None)
    result.assert_as_claimed()
    assert [again.way for again in result.again if again.identical][2:4] == [
        "restored in the grip",
        "restored after the swing",
    ]


def test_side_by_side_gives_the_same(
    replayed: Callable[..., Replay], handle_of: Callable[..., SimulatorHandle]
) -> None:
    one, three = (replayed(other_mode=handle_of(), jobs=jobs) for jobs in (1, 3))
    assert tuple(again.way for again in three.again) == WAYS
    assert three.to_wire() == one.to_wire()
    assert all(again.identical for again in three.again)


def test_an_interrupt_ends_what_runs_side_by_side(
    replayed: Callable[..., Replay],
    handle_of: Callable[..., SimulatorHandle],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("pytest_simbench.repeatability.replay._after_another", interrupted)
    workers = [handle_of(), handle_of()]
    with pytest.raises(KeyboardInterrupt):
        replayed(fresh=workers[0], other_mode=workers[1], jobs=3)
    assert [handle._process for handle in workers] == [None, None]


class Written(SimulatorHandle):
    """A handle without a worker: what is done with it is written down, and `end` says what becomes
    of its runs."""

    def __init__(self, end: Any = None, mode: str = "headless") -> None:
        super().__init__(SimpleNamespace(simulator="sim", mode=mode))  # type: ignore[arg-type]
        self.end, self.done = end, []
        self.closed = threading.Event()

    @contextmanager
    def episode(self, scene: Scene, **options: Any) -> Iterator[Any]:
        self.done.append(scene)
        if self.end is not None:
            raise self.end
        yield SimpleNamespace(wait=self.done.append)

    def close(self) -> None:
        self.closed.set()


TAPE = [operation("wait", *told) for told in (("fly", 0.1), ("fall", 0.2), ("fly", 0.3))]
FIRST = replace(moved(0.0), tape=TAPE)
AWAY = replace(moved(0.001, {**ALL, "standing": 0.5}), left_at=0.7)
WHERE = Where("sim", "headless")


class Known:
    """Episodes that are written down: the first one, and how it ends when it is run again."""

    task = SimpleNamespace(name="scripted", moments=(Moment("again in flight", "fly", 1),))

    def __init__(self, own: Written) -> None:
        self.handle, self.told = own, []

    def run(self, *, play: Any = None, before: Any = None, handle: Any = None) -> Episode:
        self.told.append((play, handle))
        world: Any = SimpleNamespace(
            **{k: lambda what, k=k: self.told.append((k, what)) for k in ("save", "restore")},
            perform=self.told.append,
        )
        for asked in play if before else ():
            before(world, asked)
        if isinstance(handle, Written) and isinstance(handle.end, Exception):
            raise handle.end
        if isinstance(handle, Written) and handle.end:
            assert handle.closed.wait(PATIENCE)
        return AWAY if self.handle.done[-1:] == [0.5] else FIRST


def again(**given: Any) -> tuple[Known, Replay]:
    """Of known episodes in a simulator that claims all, run again in every way."""
    known = Known(given.pop("own", Written()))
    options = {"capabilities": EVERYTHING, "fresh": Written(), "other_mode": "no display", **given}
    return known, replay(known, **options)  # type: ignore[arg-type]


APART = {
    **vars(difference(FIRST.motions, AWAY.motions, NAMES)), "changed": ["standing"], "left_at": 0.7
}  # fmt: skip
AGAIN = (
    Again(way="after a reset", changed=[]),
    Again(way="after another episode", **APART),
    Again(way="restored again in flight", **APART),
    Again(way="fresh process", skipped="no driver"),
    Again(way="with a window", failure="WorkerExited: it is gone"),
)
"""What is found of a simulator that knows that another scene was there."""


@pytest.mark.parametrize("jobs", [1, 2, 3])
def test_all_that_is_run_again(monkeypatch: pytest.MonkeyPatch, jobs: int) -> None:
    """With the first one's commands, and what is done in between is what should not matter."""
    many: list[int] = []

    def pool(most: int, **named: str) -> ThreadPoolExecutor:
        many.append(most)
        return ThreadPoolExecutor(most, **named)  # type: ignore[arg-type]

    monkeypatch.setattr("pytest_simbench.repeatability.replay.ThreadPoolExecutor", pool)
    fresh = Written(Unavailable("no driver", WHERE))
    other = Written(WorkerExited("it is gone", WHERE))
    known, found = again(fresh=fresh, other_mode=other, jobs=jobs)
    assert found == Replay("sim", True, FIRST, AGAIN)
    assert many == [max(1, jobs - 1)]
    assert known.handle.done == [ANOTHER, 0.5]
    asked = [(None, None), *[(TAPE, handle) for handle in (None, None, None, fresh, other)]]
    saved = [
        ("save", "replay"),
        TAPE[2],
        Operation("wait", {"duration": 0.3}),
        ("restore", "replay"),
    ]
    if jobs == 1:
        assert known.told == [*asked[:4], *saved, *asked[4:]]
    assert sorted(map(str, known.told)) == sorted(map(str, [*asked, *saved]))


def test_what_is_claimed_of_it() -> None:
    every, restoring = EVERYTHING - {Capability.DETERMINISTIC}, "restored again in flight"
    assert [one.claimed for one in again(capabilities=every)[1].again] == [False] * 5
    found = again(capabilities=EVERYTHING - {Capability.EXACT_RESTORE}, own=Written(mode="gui"))[1]
    assert {one.way for one in found.again if not one.claimed} == {restoring}
    assert found.again[-1] == Again(way="headless", skipped="no display")
    _, found = again(capabilities=EVERYTHING - {Capability.SAVE_RESTORE}, moments=MOMENTS)
    assert found.again[2] == Again(way="restored in flight", skipped="sim cannot save and restore")
    for moments, told in (
        ((), Again(way="restored", skipped="the task 'scripted' declares no moments")),
        ((Moment("x", "fly", 2),), Again(way="restored x", skipped="the task never came to fly")),
    ):
        assert again(moments=moments)[1].again[2] == told


def test_who_is_interrupted_ends_what_runs_side_by_side() -> None:
    others = [Written("waits until it is closed") for _ in range(2)]
    with pytest.raises(KeyboardInterrupt):
        again(own=Written(KeyboardInterrupt()), fresh=others[0], other_mode=others[1], jobs=3)
    assert all(one.closed.is_set() for one in others)


PARTED = {"first": 1.25, "body": "a", "growth": {"1": 0.0012, "5": None}, "largest": 0.02}


@pytest.mark.parametrize(
    ("again", "identical", "text"),
    [
        (Again(way="w"), True, "bit-identical"),
        (Again(way="w", left_at=2.5, claimed=False), True, "bit-identical"),
        (Again(way="w", skipped="no window"), False, "no window"),
        (Again(way="w", failure="WorkerExited: gone"), False, "WorkerExited: gone"),
        (
            Again(way="w", changed=["placed", "hit"], **PARTED),
            False,
            "first differs at t = 1.25 s (a), then 1.2 mm 1 s later, 20 mm at most; changed "
            "placed, hit",
        ),
        (
            Again(way="w", first=1.0, body="", growth={}, largest=0.0),
            False,
            "first differs at t = 1.00 s (robot), 0 mm at most",
        ),
    ],
)
def test_running_again_in_words_and_on_the_wire(again: Again, identical: bool, text: str) -> None:
    assert (again.identical, again.text) == (identical, text)
    wire = json.loads(json.dumps(again.to_wire()))
    assert wire["identical"] is identical
    assert replace(convert(wire, Again), changed=again.changed) == again
    del wire["claimed"]
    assert convert(wire, Again).claimed


def test_what_a_claim_of_determinism_means() -> None:
    fine, skipped = Again(way="reset"), Again(way="window", skipped="none here")
    parted, hidden = Again(way="fresh", **PARTED), Again(way="restored", claimed=False, **PARTED)
    broken = Again(way="window", failure="WorkerExited: gone", claimed=False)
    first = moved(0.0)
    Replay("sim", True, first, (fine, skipped, hidden)).assert_as_claimed()
    for claims, ways, bad, head in (
        (True, (fine, parted), (parted,), "claims to be deterministic, but"),
        (False, (fine, hidden, broken), (broken,), "could not run again"),
        (True, (parted, broken), (parted, broken), "claims to be deterministic, but"),
    ):
        with pytest.raises(AssertionError) as caught:
            Replay("sim", claims, first, ways).assert_as_claimed()
        lines = [f"sim {head}", *(f"  {again.way}: {again.text}" for again in bad)]
        assert str(caught.value) == "\n".join(lines)
    wire = Replay("sim", True, first, (fine, parted)).to_wire()
    assert wire == {
        "claims": True,
        "counts": {"standing": 1.0, "lost": 0.0},
        "again": [fine.to_wire(), parted.to_wire()],
    }
