"""The search finds what topples a tower that is known to topple, and shrinks it. What it makes of
runs that are known, and of those of an engine."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from pytest_simbench.cli.main import main
from pytest_simbench.client.answers import Constructed
from pytest_simbench.repeatability.episode import Episode, Episodes
from pytest_simbench.repeatability.perturbation import Perturbation, described
from pytest_simbench.repeatability.search import (
    Attack,
    Finding,
    Trial,
    bounds_in_words,
    divergence,
    effect,
    search,
    to_wire,
)
from pytest_simbench.tasks import Jitter, Stacking, Throwing
from pytest_simbench.tasks.base import Outcome
from tests.repeatability.scripted import (
    ALL,
    Perturbed,
    Scripted,
    dead,
    episode,
    motion,
    moved,
    operation,
    shift,
    toppling,
)

search_module = sys.modules[search.__module__]

WIDE = {"x": 0.012, "y": 0.012, "yaw": math.radians(10), "mass": 0.5, "friction": 0.5}
"""Enough to topple a tower with 8 mm to spare, among much that is not."""


def test_finds_what_topples_a_tower_among_much_that_does_not(
    towers: Callable[..., Episodes],
) -> None:
    finding = search(towers("pybullet"), WIDE)
    finding.assert_found()
    assert 1 <= finding.examples <= 60
    assert finding.runs <= finding.examples + 60
    assert len(finding.smallest) <= len(finding.first)
    assert finding.effect == "topples tower 1"


def test_shrinks_to_the_margin_and_tells_how_to_replay(
    towers: Callable[..., Episodes], capsys: pytest.CaptureFixture[str]
) -> None:
    """Drawing the lowest cube back by the margin, 8 mm, topples the tower, as statics has it, and
    0.1 mm less does not."""
    episodes = towers()
    finding = search(episodes, {"x": 0.012}, at_once=1)
    assert finding.smallest is not None
    (smallest,) = finding.smallest
    assert (smallest.quantity, smallest.body) == ("x", "cube_01")
    assert 7.4 <= -1000 * smallest.amount <= 8.2
    assert finding.sentence == f"{smallest} topples tower 1"
    less = Perturbation("x", smallest.steps + 1, smallest.body)
    assert not Attack(episodes, 10).run((less,)).effect
    finding.assert_not_below("x", 0.004)
    with pytest.raises(
        AssertionError,
        match=r"mm in x of cube_01 topples tower 1, though it should bear 9 mm\n"
        r"replay it: simbench replay .*smallest-leaning_towers-mujoco",
    ):
        finding.assert_not_below("x", 0.009)
    assert main(["replay", finding.replay.rpartition(" ")[2]]) == 0
    told = capsys.readouterr().out
    moved = {
        line.split(":")[0].strip(): float(line.split(", ")[1].split()[0])
        for line in told.splitlines()[1:]
    }
    assert moved["cube_04"] > 50 > 10 > moved["cube_01"]


def test_how_far_a_cube_goes_another_way() -> None:
    """Its displacement at the start does not count: 4 x - x."""
    for x in (0.001, -0.001):
        assert divergence(moved(0.0), moved(x)) == pytest.approx(0.003)
    ways = [[(0.1, 0.5), (0.7, 0.9), (0.3, 0.4)], [(0.2, 0.6), (0.9, 0.7), (0.5, 0.45)]]
    three, other = (
        episode(ALL, [motion([k], [a], [b]) for k, (a, b) in enumerate(way)]) for way in ways
    )
    assert divergence(three, other) == pytest.approx(0.1)
    nobody = episode(ALL, [motion([0.0]), motion([1.0])])
    assert divergence(nobody, nobody) == 0.0


def test_an_attack_remembers_and_ends() -> None:
    step = [(Perturbation("x", n, "a"),) for n in range(4)]

    def run(perturbed: Perturbed) -> Episode:
        if shift(perturbed) > 1.5e-4:
            return moved(shift(perturbed), {**ALL, "standing": 0.5, "lost": 1.0})
        return moved(shift(perturbed))

    experiment = Scripted(run)
    attack = Attack(experiment, 2)
    assert [asked[0] for asked in experiment.asked] == [()]
    harmless, harmful = attack.trial(step[1]), attack.trial(step[2])
    assert harmless == Trial(pytest.approx(3e-4), kept=1.0)
    assert (harmful.effect, harmful.kept) == ("changes standing from 100 % to 50 %", 0.5)
    assert attack.trial(step[3]) is None  # no more than two
    assert attack.trial(step[2]) is harmful
    assert len(experiment.asked) == 3
    attack.examples = 3
    assert attack.trial(step[3]) is not None
    assert list(attack.trials) == step[1:]
    assert [step for step, trial in attack.trials.items() if trial.tape] == step[2:]


def test_a_crash_keeps_nothing() -> None:
    def run(perturbed: Perturbed) -> Episode:
        if perturbed:
            raise dead(perturbed)
        return moved(0.0)

    trial = Attack(Scripted(run), 1).trial((Perturbation("x", 1, "a"),))
    assert trial == Trial(1.0, "ends in WorkerExited", 0.0)


@pytest.mark.parametrize(
    ("after", "kept"),
    [
        ({"standing": 1.0, "lost": 1.0}, 1.0),
        ({"standing": 0.25, "lost": 0.0}, 0.5),
        ({"standing": None, "lost": 0.0}, 0.0),
    ],
)
def test_what_is_kept_is_of_what_could_be_lost(after: dict[str, float | None], kept: float) -> None:
    """Of counts that are good when high, and were not 0; never more than all."""
    experiment = Scripted(lambda p: moved(0.0, after if p else {"standing": 0.5, "lost": 0.0}))
    trial = Attack(experiment, 1).trial((Perturbation("x", 1, "a"),))
    assert trial.kept == kept


def test_effects_of_what_is_none() -> None:
    task = Scripted(lambda p: moved(0.0)).task
    before, after = Outcome({"standing": 1.0}), Outcome({"standing": None})
    assert effect(task, before, after, ["standing"]) == "changes standing from 100 % to none"
    assert effect(task, after, before, ["standing"]) == "changes standing from none to 100 %"
    some = Outcome({}, {"toppled": ["a"]})
    more = Outcome({}, {"toppled": ["a", "b"]})
    assert effect(task, some, more, ["standing"]) == "topples b"
    assert effect(task, more, some, ["standing"]) == "saves b from toppling"
    assert effect(task, some, some, ["standing"]) == "changes standing from none to none"
    assert effect(task, some, more, []) == ""
    before, after = Outcome({"at_end": 1.0}), Outcome({"at_end": 0.8})
    words = "changes at the end from 100 % to 80 %"  # a task that says nothing of its own
    assert effect(Stacking(), before, after, ["at_end"]) == words


@pytest.fixture
def unkept(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is found is kept in no file."""
    monkeypatch.setattr(search_module, "_kept_example", lambda attack, smallest: "replay me")


@pytest.mark.usefixtures("unkept")
def test_a_search_of_a_known_world() -> None:
    """0.5 mm topples one, and less does nothing."""
    experiment = Scripted(toppling)
    found = search(experiment, {"x": 2e-3}, examples=40, at_once=1)
    assert [(p.quantity, abs(p.steps), p.body) for p in found.smallest] == [("x", 5, "a")]
    assert found.effect == "topples one"
    assert found.confirmed is True
    tried = [asked[0] for asked in experiment.asked]
    assert tried[0] == ()
    first = next(k for k, p in enumerate(tried) if abs(shift(p)) > 4.5e-4)
    assert (tried[first], found.examples) == (found.first, first)
    # the base, and the two runs that confirm, are no trials
    assert tried[-2:] == [(), found.smallest]
    assert found.runs == len(tried) - 3
    assert (found.bounds, found.replay) == ("2 mm in x", "replay me")
    assert found.before == "standing 1.0, lost 0.0"
    found.assert_found()
    found.assert_not_below("x", 4e-4)
    found.assert_not_below("yaw", 1.0)
    same = search(Scripted(toppling), {"x": 2e-3}, examples=40, at_once=1)
    assert same == found
    with pytest.raises(AssertionError) as caught:
        found.assert_not_below("x", 6e-4)
    assert str(caught.value) == (
        f"sim: {found.smallest[0]} topples one, though it should bear 0.6 mm\nreplay it: replay me"
    )


def test_a_search_that_finds_nothing_makes_all_its_runs() -> None:
    """One in six perturbs one thing alone, the others up to a dozen."""
    experiment = Scripted(lambda perturbed: moved(0.0))
    found = search(experiment, {"x": 2e-3, "y": 2e-3}, examples=18)
    assert (found.smallest, found.first, found.examples) == (None, None, 0)
    assert found.runs == len(experiment.asked) - 1 <= 18
    assert (found.effect, found.replay, found.confirmed) == ("", "", False)
    alone = [len(asked[0]) for asked in experiment.asked[1:]]
    assert set(alone[:3]) == {1}
    assert max(alone[3:]) > 1
    assert found.sentence == (
        f"nothing within 2 mm in x, 2 mm in y changed the outcome in {found.runs} examples"
    )
    with pytest.raises(AssertionError, match="^sim: nothing within 2 mm in x, 2 mm in y changed"):
        found.assert_found()
    with pytest.raises(LookupError, match="^no perturbation of x was found: nothing within"):
        found.amount("x")
    assert to_wire(found) == {
        "sentence": found.sentence, "smallest": None, "effect": "", "examples": 0,
        "runs": found.runs,
        "confirmed": False, "first": None, "bounds": found.bounds, "before": found.before,
        "replay": "",
    }  # fmt: skip


@pytest.mark.usefixtures("unkept")
def test_shrinking_has_its_bound() -> None:
    experiment = Scripted(toppling)
    found = search(experiment, {"x": 2e-3}, examples=40, shrinks=2, at_once=1)
    assert found.runs <= found.examples + 2
    assert search(Scripted(lambda p: moved(0.0)), {"x": 2e-3}, examples=1).runs == 1


@pytest.mark.usefixtures("unkept")
@pytest.mark.parametrize("bad", [range(3, 4), range(3, 10_000)], ids=["moody", "aging"])
def test_what_the_perturbation_did_not_do_is_not_confirmed(bad: range) -> None:
    """A world that was bad by itself, the third or all from there on: the same perturbation, or
    none, gives another result."""
    worlds = iter(range(1, 10_000))

    def run(perturbed: Perturbed) -> Episode:
        return toppling((Perturbation("x", 5 * (next(worlds) in bad), "a"),))

    found = search(Scripted(run), {"y": 1e-3}, examples=8, shrinks=5, at_once=1)
    assert (found.effect, found.examples, found.confirmed) == ("topples one", 2, False)
    assert found.sentence.endswith(" topples one (not confirmed by a second run)")
    with pytest.raises(AssertionError, match="not confirmed"):
        found.assert_found()


def test_several_count_together() -> None:
    both = (Perturbation("x", 3, "a"), Perturbation("x", -2, "b"), Perturbation("yaw", 1, "a"))
    found = Finding("sim", both, "topples it", 3, 9, True, None, "", "", "")
    assert found.amount("x") == pytest.approx(5e-4)
    assert found.sentence == (
        "0.3 mm in x of a and -0.2 mm in x of b and 0.1 deg of yaw of a topples it"
    )
    found.assert_not_below("x", 1.0)  # with something else perturbed it says nothing of x
    assert to_wire(found)["smallest"] == [
        {"quantity": "x", "steps": 3, "body": "a"},
        {"quantity": "x", "steps": -2, "body": "b"},
        {"quantity": "yaw", "steps": 1, "body": "a"},
    ]


def test_bounds_in_words() -> None:
    experiment = Scripted(toppling)
    assert bounds_in_words(experiment, {"x": 1e-3, "mass": 0.1}) == "1 mm in x, 10 % in mass"
    every = "1 mm in x, 1 mm in y, 1 deg in yaw, 10 % in mass, 20 % in friction"
    assert bounds_in_words(experiment, None) == every
    scene = Throwing().scene(1, Jitter())
    with_robot = bounds_in_words(SimpleNamespace(scene=lambda: scene), None)
    assert with_robot == f"{every}, 20 % in squeeze, 20 ms in delay"


def test_the_smallest_is_kept_as_an_example(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """With its own scene and commands, and the line that replays it, also of a crash; none where
    the folder takes none. Another search, of the same test too, has another file."""
    kept: list[Any] = []
    experiment = Scripted(toppling)
    case = experiment.handle.case
    experiment.handle.constructed = Constructed(versions={"sim": "1"})

    def write(*arguments: Any) -> Path:
        kept.append(arguments)
        return tmp_path / "example.json"

    def command(path: Path, of: Any, scene: Any) -> str:
        return f"replay {path.name} of {scene.body('a').pose.position[0]:.4f}"

    monkeypatch.setattr(search_module, "write_example", write)
    monkeypatch.setattr(search_module, "replay_command", command)
    found = search(experiment, {"x": 2e-3}, examples=40, at_once=1)
    x = shift(found.smallest)
    assert found.replay == f"replay example.json of {x:.4f}"
    ((of, name, scene, tape, versions),) = kept
    assert (of, name[:31]) == (case, "smallest-scripted-sim-headless-")
    assert scene.body("a").pose.position[0] == pytest.approx(x)
    assert (tape, versions) == (moved(0.0).tape, {"sim": "1"})
    assert to_wire(found)["first"] == described(found.first or ())
    found.assert_not_below("x", found.amount("x"))

    def crashing(perturbed: Perturbed) -> Episode:
        crashes.handle.tape = [operation("wait", "fall", perturbed[0].amount)] if perturbed else []
        if abs(shift(perturbed)) > 5.5e-4:
            raise dead(perturbed)
        return moved(0.0)

    crashes = Scripted(crashing)
    crash = search(crashes, {"x": 2e-3}, examples=40, at_once=1)
    assert (crash.effect, crash.replay[:22]) == ("ends in WorkerExited", "replay example.json of")
    assert kept[1][1] not in (name, "smallest-scripted-sim-headless")
    assert [o.duration for o in kept[1][3]] == [shift(crash.smallest)]

    def full(*arguments: Any) -> Path:
        raise OSError("no space")

    monkeypatch.setattr(search_module, "write_example", full)
    assert search(experiment, {"x": 2e-3}, examples=40, at_once=1).replay == ""
