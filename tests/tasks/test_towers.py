"""Leaning towers lean as far as statics says."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.tasks import Jitter, LeaningTowers
from pytest_simbench.tasks.base import CUBE_SIZE
from tests.tasks.scripted import Mishap, move, perform


@given(margin=st.floats(0.0, 0.024), levels=st.integers(2, 8))
def test_the_margin_is_what_the_lowest_cube_can_be_drawn_back(margin: float, levels: int) -> None:
    """By moments: the cubes above have their centre of mass `margin` inside the lowest one's
    edge, and every higher interface has as much to spare or more."""
    scene = LeaningTowers(margins=(margin,), levels=levels).scene(1, Jitter())
    x = np.array([body.pose.position[0] for body in scene.bodies])
    spare = [x[k] + CUBE_SIZE / 2 - x[k + 1 :].mean() for k in range(levels - 1)]
    assert spare[0] == pytest.approx(margin, abs=1e-12)
    assert min(spare) >= margin - 1e-12


def test_smoke_is_one_tower_for_a_shorter_time() -> None:
    assert LeaningTowers().smoke() == LeaningTowers(margins=(0.008,), settle=1.5)
    assert LeaningTowers(settle=1.0).smoke().settle == 1.0


def test_every_score_of_towers_of_which_one_stands_one_lost_a_cube_one_fell() -> None:
    outcome, process = perform(
        LeaningTowers(levels=3),
        Mishap("settle", 1.0, move("cube_01", x=0.0099)),
        Mishap("settle", 2.9, move("cube_06", z=-0.0101)),
        *(Mishap("settle", 2.99, move(f"cube_0{k}", x=0.1)) for k in (7, 8, 9)),
    )
    assert outcome.metrics == pytest.approx({"standing": 5 / 9, "towers": 1 / 3})
    assert outcome.details == {
        "fallen": ["cube_06", "cube_07", "cube_08", "cube_09"],
        "toppled": ["tower 2", "tower 3"],
    }
    assert process.counts == [(5, 9)]
    assert [(a.phase, a.kind, a.duration) for a in process.asked] == [("settle", "wait", 3.0)]
    assert process.marks == {"start": 0.0, "end": 3.0}


@pytest.mark.parametrize(
    ("offset", "standing"),
    [
        ({"x": -0.0099}, 1.0), ({"x": -0.0101}, 0.75),
        ({"y": 0.0101}, 0.75), ({"z": -0.0101}, 0.75),
        ({"x": 0.006, "y": 0.006, "z": 0.006}, 0.75), ({"x": 0.005, "y": 0.005, "z": 0.005}, 1.0),
        ({"y": 0.01}, 1.0), ({"tilt": 0.5}, 1.0),
    ],
)  # fmt: skip
def test_a_cube_stands_within_1_cm_of_its_start(offset: dict[str, float], standing: float) -> None:
    task = LeaningTowers(margins=(0.01,))
    outcome, _ = perform(task, Mishap("settle", 2.0, move("cube_03", **offset)))
    assert outcome.metrics["standing"] == standing
    assert outcome.metrics["towers"] == math.floor(standing)
