"""What became of a thrown cube: when it left the hand, how, and where it was going."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pytest_simbench.scene import FloatArray

FREE_FALL_TOLERANCE = 2.0
"""A cube whose acceleration is within this of gravity flies freely [m/s^2]. In the hand it is
swung at 20 m/s^2 and more; in flight, engines' air damping makes 0.1 m/s^2."""

OUT_OF_HAND = 0.06
"""Farther than this from the tool centre point, a cube is certainly not held [m]."""


@dataclass(frozen=True)
class Flight:
    """The free flight of the cube, cut out of a motion's samples.

    Attributes:
        first: index of the first sample in free flight: the release.
        last: index of the last one: before the first contact.
    """

    first: int
    last: int


def free_flight(
    time: FloatArray, position: FloatArray, velocity: FloatArray, tool: FloatArray, gravity: FloatArray
) -> Flight | None:
    """The cube's first free flight after it left the hand, or None if it never flew.

    Args:
        time: of each sample [s], (n,), evenly spaced.
        position: of the cube [m], (n, 3).
        velocity: of the cube [m/s], (n, 3).
        tool: position of the tool centre point [m], (n, 3).
        gravity: [m/s^2], (3,).
    """
    outside = np.flatnonzero(np.linalg.norm(position - tool, axis=1) > OUT_OF_HAND)
    if not len(outside) or len(time) < 3:
        return None
    acceleration = np.diff(velocity, axis=0) / np.diff(time)[:, None]
    free = np.linalg.norm(acceleration - gravity, axis=1) < FREE_FALL_TOLERANCE
    start = int(outside[0])
    flying = np.flatnonzero(free[start:])
    if not len(flying):
        return None
    anchor = first = last = start + int(flying[0])
    while first > 0 and free[first - 1]:
        first -= 1
    while last + 1 < len(free) and free[last + 1]:
        last += 1
    # free[k] speaks of the time from sample k to k + 1
    return Flight(first, last + 1) if last + 1 > anchor else None


def landing_x(position: FloatArray, velocity: FloatArray, gravity: FloatArray, height: float) -> float:
    """Where a free body crosses `height` on its way down, in x [m]: z + v t - g t^2 / 2 = height.

    Args:
        position: [m], (3,).
        velocity: [m/s], (3,).
        gravity: [m/s^2], (3,), pointing down.
        height: [m]; the body must be able to reach it.
    """
    g = -float(gravity[2])
    root = float(velocity[2]) ** 2 + 2 * g * (float(position[2]) - height)
    if root < 0:
        return float("nan")
    t = (float(velocity[2]) + np.sqrt(root)) / g
    return float(position[0] + velocity[0] * t + 0.5 * float(gravity[0]) * t * t)
