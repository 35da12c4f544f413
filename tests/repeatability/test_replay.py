"""Replay tells simulators that repeat themselves from those that do not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from pytest_simbench.experiment.handle import SimulatorHandle
from pytest_simbench.repeatability.episode import Episodes
from pytest_simbench.repeatability.replay import Replay, replay
from pytest_simbench.simulator import Capability
from pytest_simbench.tasks import Moment, Throwing
from tests.repeatability.conftest import first_seed

EVERYTHING = frozenset(Capability)
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
