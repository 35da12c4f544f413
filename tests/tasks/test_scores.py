"""Scores, on poses and flights made by hand."""

from __future__ import annotations

import math

import pytest

from pytest_simbench.scene import Pose
from pytest_simbench.tasks.stacking import Place, _placed, _strict
from pytest_simbench.tasks.throwing import _moved

PLACE = Place(0, 1, Pose.at(0.5, 0.0, 0.375))


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
