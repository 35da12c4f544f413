"""The search finds what topples a tower that is known to topple, and shrinks it."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest

from pytest_simbench.repeatability.__main__ import main
from pytest_simbench.repeatability.attack import Attack
from pytest_simbench.repeatability.episode import Episodes
from pytest_simbench.repeatability.perturbation import Perturbation
from pytest_simbench.repeatability.search import Finding, search, to_wire

WIDE = {"x": 0.012, "y": 0.012, "yaw": math.radians(10), "mass": 0.5, "friction": 0.5}
"""Enough to topple a tower with 8 mm to spare, among much that is not."""


@pytest.mark.parametrize("random_seed", [0, 1])
def test_finds_what_topples_a_tower_among_much_that_does_not(
    towers: Callable[..., Episodes], random_seed: int
) -> None:
    finding = search(towers("pybullet"), WIDE, random_seed=random_seed)
    finding.assert_found()
    assert 1 <= finding.examples <= 60
    assert finding.runs <= finding.examples + 60
    assert finding.smallest is not None
    assert finding.first is not None
    assert len(finding.smallest) <= len(finding.first)
    assert finding.effect == "topples tower 1"


@pytest.mark.parametrize(("name", "low", "high"), [("mujoco", 7.4, 8.2), ("pybullet", 5.2, 6.2)])
def test_shrinks_to_the_margin(
    towers: Callable[..., Episodes], name: str, low: float, high: float
) -> None:
    """Drawing the lowest cube back by the margin, 8 mm, topples the tower, as statics has it.
    PyBullet's does not wait so long: its solver has not converged when the tower is built."""
    finding = search(towers(name), {"x": 0.012}, at_once=1)
    finding.assert_found()
    assert 1 <= finding.examples <= 60
    assert finding.smallest is not None
    (smallest,) = finding.smallest
    assert (smallest.quantity, smallest.body) == ("x", "cube_01")
    assert low <= -1000 * smallest.amount <= high
    assert finding.sentence == f"{smallest} topples tower 1"
    assert finding.amount("x") == -smallest.amount


def test_one_step_less_does_not_topple(towers: Callable[..., Episodes]) -> None:
    """The result is the smallest one: it topples, and 0.1 mm less does not."""
    episodes = towers()
    finding = search(episodes, {"x": 0.012}, at_once=1)
    assert finding.smallest is not None
    (smallest,) = finding.smallest
    attack = Attack(episodes, 10)
    less = Perturbation("x", smallest.steps + 1, smallest.body)
    assert attack.run(finding.smallest).effect == "topples tower 1"
    assert not attack.run((less,)).differs


def test_same_seed_same_search(towers: Callable[..., Episodes]) -> None:
    first, second = (to_wire(search(towers(), {"x": 0.012}, shrinks=3)) for _ in range(2))
    assert first == second


def test_nothing_found_is_a_sentence_and_a_failed_assertion(
    towers: Callable[..., Episodes],
) -> None:
    finding = search(towers(), {"y": 0.001}, examples=5)
    assert finding.smallest is None
    assert 3 <= finding.runs <= 5  # Hypothesis does not run an example twice
    tried = f"{finding.runs} examples"
    assert finding.sentence == f"nothing within 1 mm in y changed the outcome in {tried}"
    finding.assert_not_below("y", 0.001)
    with pytest.raises(AssertionError, match="mujoco: nothing within 1 mm in y"):
        finding.assert_found()
    with pytest.raises(LookupError, match="nothing within"):
        finding.amount("y")


def test_examples_bound_the_runs_with_shrinking(towers: Callable[..., Episodes]) -> None:
    """A search that is cut short in shrinking still has what it found."""
    finding = search(towers(), {"x": 0.012}, shrinks=5, at_once=1)
    assert finding.runs <= finding.examples + 5
    assert finding.amount("x") >= 0.0074
    finding.assert_found()


def test_too_little_is_enough_fails_and_tells_how_to_replay(
    towers: Callable[..., Episodes], capsys: pytest.CaptureFixture[str]
) -> None:
    finding = search(towers(), {"x": 0.012}, at_once=1)
    finding.assert_not_below("x", 0.004)
    with pytest.raises(
        AssertionError,
        match=r"mm in x of cube_01 topples tower 1, though it should bear 9 mm\n"
        r"replay it: simbench replay .*smallest-leaning_towers-mujoco",
    ):
        finding.assert_not_below("x", 0.009)
    assert main([finding.replay.rpartition(" ")[2]]) == 0
    told = capsys.readouterr().out
    moved = {
        line.split(":")[0].strip(): float(line.split(", ")[1].split()[0])
        for line in told.splitlines()[1:]
    }
    assert moved["cube_04"] > 50 > 10 > moved["cube_01"]


def test_a_crash_is_a_finding(towers: Callable[..., Episodes]) -> None:
    """It does not end the search: the next example gets a fresh worker."""
    finding = search(towers("Brittle"), {"friction": 0.2}, examples=30)
    finding.assert_found()
    assert finding.sentence == "6 % in the friction of all surfaces ends in WorkerExited"


def test_a_result_that_does_not_come_again_is_not_confirmed() -> None:
    doubtful = Finding(
        "x", (Perturbation("x", 7, "cube_12"),), "topples tower 2", 3, 9, False, None, "", ""
    )
    assert doubtful.sentence == (
        "0.7 mm in x of cube_12 topples tower 2 (not confirmed by a second run)"
    )
    with pytest.raises(AssertionError, match="not confirmed"):
        doubtful.assert_found()


@pytest.mark.parametrize("name", ["Moody", "Aging"])
def test_what_the_perturbation_did_not_do_is_not_confirmed(
    towers: Callable[..., Episodes], name: str
) -> None:
    """A world that was bad by itself: the same perturbation, or none, gives another result."""
    finding = search(towers(name), {"y": 0.001}, examples=8, shrinks=5, at_once=1)
    assert finding.effect == "topples tower 1"
    assert finding.examples == 2  # the third world: unperturbed, first, second example
    assert finding.confirmed is False
    assert finding.sentence.endswith(" topples tower 1 (not confirmed by a second run)")
    with pytest.raises(AssertionError, match="not confirmed"):
        finding.assert_found()


def test_a_true_finding_is_confirmed(towers: Callable[..., Episodes]) -> None:
    finding = search(towers(), {"x": 0.012}, shrinks=2, at_once=1)
    assert finding.confirmed is True
    assert to_wire(finding)["confirmed"] is True


def test_noise_is_no_finding(towers: Callable[..., Episodes]) -> None:
    """A simulator that never does the same twice cannot make the search flaky; what it finds at
    the edge may not be confirmed."""
    finding = search(towers("Noisy"), {"x": 0.012}, shrinks=30, at_once=1)
    assert finding.effect == "topples tower 1"
    assert 0.007 < finding.amount("x") < 0.009


def test_example_files_are_in_the_run_folder(
    towers: Callable[..., Episodes], tmp_path: Path
) -> None:
    search(towers(), {"x": 0.012}, shrinks=1)
    (path,) = (tmp_path / "examples").iterdir()
    assert path.name.startswith("smallest-leaning_towers-mujoco-headless-")
