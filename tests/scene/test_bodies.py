"""Bodies: inertia, penetration, and how they cross to another process."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.scene import Body, Box, Pose, SceneError, penetration

UNIT = Box("unit", (1.0, 1.0, 1.0), Pose())


def test_inertia_of_a_box() -> None:
    box = Box("b", (1.0, 2.0, 3.0), Pose(), mass=12.0)
    assert np.allclose(box.inertia(), [4 + 9, 1 + 9, 1 + 4])


@given(st.floats(0.0, 2.0))
def test_depth_along_an_axis(x: float) -> None:
    other = UNIT.moved_to(Pose.at(x, 0, 0))
    depth = penetration(UNIT, other)
    assert max(depth, 0.0) == pytest.approx(max(1.0 - x, 0.0), abs=1e-9)


@given(st.tuples(*[st.floats(-1.5, 1.5)] * 3), st.floats(-math.pi, math.pi))
def test_penetration_is_symmetric(at: tuple[float, float, float], yaw: float) -> None:
    other = UNIT.moved_to(Pose.at(*at, yaw=yaw))
    assert penetration(UNIT, other) == pytest.approx(penetration(other, UNIT), abs=1e-9)


def test_turned_by_45_degrees_reaches_farther() -> None:
    other = UNIT.moved_to(Pose.at(1.1, 0, 0, yaw=math.pi / 4))
    assert penetration(UNIT, other) == pytest.approx(0.5 + math.sqrt(0.5) - 1.1)


def test_what_is_as_by_default_is_not_written() -> None:
    """Fingerprints of a scene are made of what it writes, and stay as they were."""
    assert list(UNIT.to_wire()) == ["name", "size", "pose", "mass", "friction", "colour"]


def test_a_moving_body_crosses() -> None:
    thrown = Box(
        "thrown",
        (1.0, 2.0, 3.0),
        Pose.at(1, 2, 3, yaw=0.3),
        2.0,
        linear_velocity=(1.0, 2.0, 3.0),
        angular_velocity=(0.0, 0.0, -1.0),
    )
    assert Body.from_wire(thrown.to_wire()) == thrown
    assert thrown.velocity.tolist() == [1, 2, 3, 0, 0, -1]


def test_a_fixed_body_does_not_start_to_move() -> None:
    with pytest.raises(SceneError, match="'post' has a velocity and no mass"):
        Box("post", (1.0, 1.0, 1.0), Pose(), angular_velocity=(0.0, 0.0, 1.0))
