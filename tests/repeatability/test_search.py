"""The search finds what topples a tower that is known to topple, and shrinks it."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from pytest_simbench.cli.main import main
from pytest_simbench.repeatability.episode import Episodes
from pytest_simbench.repeatability.perturbation import Perturbation
from pytest_simbench.repeatability.search import Attack, search

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
