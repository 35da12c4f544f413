"""What laws of friction share: slabs on slopes, fans of cases around a critical value, and the
acceleration of what slides."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pytest_simbench.laws.base import GRAVITY, Reading, rounding
from pytest_simbench.scene import Box, FloatArray, Pose, Scene, Vector3

SLAB: Vector3 = (0.1, 0.1, 0.02)
SLAB_AT = Pose.at(0.0, 0.0, SLAB[2] / 2)
WEDGE: Vector3 = (0.3, 0.3, 0.05)


def tilted(slope: float, direction: float) -> Vector3:
    """Gravity that makes the ground a slope [tangent], down towards `direction` [rad]."""
    angle = math.atan(slope)
    pull = GRAVITY * math.sin(angle)
    return (
        pull * math.cos(direction),
        pull * math.sin(direction),
        -GRAVITY * math.cos(angle),
    )


def slab_on(name: str, slope: float, direction: float, friction: float) -> Scene:
    """A slab of 1 kg at rest on such a slope, with one friction for both."""
    slab = Box("slab", SLAB, SLAB_AT, 1.0, friction)
    return Scene(name, (slab,), gravity=tilted(slope, direction), ground_friction=friction)


def slope_pose(slope: float, direction: float) -> Pose:
    """A turn that tilts a level plane so that it goes down towards `direction` [rad]."""
    half = math.atan(slope) / 2
    down = Pose(quaternion=(math.cos(half), 0.0, math.sin(half), 0.0))
    return Pose.at(0.0, 0.0, 0.0, yaw=direction) * down


def boundary(values: Sequence[float], moved: Sequence[bool]) -> float:
    """Where rising `values` change from what stays to what moves: in the middle between the two
    neighbours, at an end where all stay or all move."""
    stay = len(values) - sum(moved)
    if 0 < stay < len(values):
        return (values[stay - 1] + values[stay]) / 2
    return values[0] if stay == 0 else values[-1]


SHARES = (0.92, 0.96, 0.98, 1.02, 1.04, 1.08)
"""Of a critical value: a fan of cases on both sides of it."""

BETWEEN = 0.02
"""Tolerance of a fan: half of the gap in which the critical value lies, as a share of it."""


def acceleration(
    dt: float, t: FloatArray, speed: FloatArray, begin: float, exact: float, force: float
) -> Reading:
    """The slope of a speed [m/s] from `begin` [s] to the end; `force`: the largest one, for each
    kg [m/s^2]."""
    used = t > begin
    found = float(np.polyfit(t[used], speed[used], 1)[0])
    span = float(t[-1]) - begin
    return Reading(found, exact, 2 * force * dt / span + rounding(1.0, len(t)))
