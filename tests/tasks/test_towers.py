"""Leaning towers lean as far as statics says."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.tasks import Jitter, LeaningTowers
from pytest_simbench.tasks.base import CUBE_SIZE


@given(margin=st.floats(0.0, 0.024), levels=st.integers(2, 8))
def test_the_margin_is_what_the_lowest_cube_can_be_drawn_back(margin: float, levels: int) -> None:
    """By moments: the cubes above have their centre of mass `margin` inside the lowest one's
    edge, and every higher interface has as much to spare or more."""
    scene = LeaningTowers(margins=(margin,), levels=levels).scene(1, Jitter())
    x = np.array([body.pose.position[0] for body in scene.bodies])
    spare = [x[k] + CUBE_SIZE / 2 - x[k + 1 :].mean() for k in range(levels - 1)]
    assert spare[0] == pytest.approx(margin, abs=1e-12)
    assert min(spare) >= margin - 1e-12


def test_towers_stand_apart_and_are_counted() -> None:
    task = LeaningTowers(margins=(0.008, 0.01), levels=3)
    scene = task.scene(1, Jitter())
    assert [body.name for body in scene.free_bodies] == [f"cube_0{n}" for n in range(1, 7)]
    assert [task.tower_of(number) for number in range(6)] == [1, 1, 1, 2, 2, 2]
    assert scene == task.scene(2, Jitter(1.0, 1.0))  # no jitter: it would eat the margin


def test_smoke_is_one_tower_for_a_shorter_time() -> None:
    assert LeaningTowers().smoke() == LeaningTowers(margins=(0.008,), settle=1.5)
    assert LeaningTowers(settle=1.0).smoke().settle == 1.0
