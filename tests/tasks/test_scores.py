"""Scores, on poses and flights made by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pytest_simbench.scene import FloatArray, Pose
from pytest_simbench.tasks.stacking import Place, _placed, _strict
from pytest_simbench.tasks.throw_analysis import free_flight, landing_x
from pytest_simbench.tasks.throwing import _moved

PLACE = Place(0, 1, Pose.at(0.5, 0.0, 0.375))
GRAVITY = np.array([0.0, 0.0, -9.80665])


def tilted(degrees: float) -> Pose:
    half = math.radians(degrees) / 2
    return Pose((0.5, 0.0, 0.375), (math.cos(half), math.sin(half), 0.0, 0.0))


@pytest.mark.parametrize(
    ("pose", "placed", "strict"),
    [
        (PLACE.pose, True, True),
        (PLACE.pose.translated(x=0.009, y=-0.009, z=0.009), True, True),
        (PLACE.pose.translated(x=0.011), True, False),
        (PLACE.pose.translated(x=0.049, y=-0.049), True, False),
        (PLACE.pose.translated(y=0.051), False, False),
        (PLACE.pose.translated(z=-0.05), True, False),
        (tilted(4.9), True, True),
        (tilted(5.1), True, False),
        (tilted(90.0), True, True),
    ],
)
def test_placed_as_the_study_and_strictly(pose: Pose, placed: bool, strict: bool) -> None:
    assert (_placed(PLACE, pose), _strict(PLACE, pose)) == (placed, strict)


def test_moved_is_more_than_5_cm_in_x_or_y() -> None:
    pose = Pose.at(1.4, 0.0, 0.125)
    assert not _moved(pose, pose.translated(x=0.049, y=0.049, z=-0.1))
    assert _moved(pose, pose.translated(y=-0.051))


def flight(release: float, contact: float) -> tuple[FloatArray, ...]:
    """A cube held at first on a swing that accelerates as gravity does, then free, then hit."""
    time = np.arange(0, 1.0, 0.002)
    position = np.array([[2.0, 0.0, 1.0]]) * time[:, None] + 0.5 * GRAVITY * time[:, None] ** 2
    velocity = np.array([2.0, 0.0, 1.0]) + GRAVITY * time[:, None]
    velocity[time >= contact] = 0.0
    fingers = np.full((len(time), 2), 0.025)
    fingers[time >= release] = 0.026
    tool = position.copy()
    tool[time >= release] -= 0.1 * (time[time >= release] - release)[:, None]
    return time, position, velocity, tool, fingers


def test_flight_begins_when_the_fingers_open_not_before() -> None:
    time, *rest = flight(0.3, 0.6)
    found = free_flight(time, *rest, GRAVITY)
    assert found is not None
    assert time[found.first] == pytest.approx(0.3, abs=0.003)
    assert time[found.last] == pytest.approx(0.598, abs=0.003)


def test_no_flight_when_the_cube_stays_in_the_hand() -> None:
    time, position, velocity, _, fingers = flight(9.0, 9.0)
    assert free_flight(time, position, velocity, position, fingers, GRAVITY) is None


def test_landing_of_a_closed_form() -> None:
    fall = math.sqrt(2 * 1.0 / 9.80665)
    x = landing_x(np.array([0.0, 0, 1.05]), np.array([2.0, 0, 0]), GRAVITY, 0.05)
    assert x == pytest.approx(2.0 * fall)
    assert math.isnan(landing_x(np.zeros(3), np.zeros(3), GRAVITY, 1.0))
