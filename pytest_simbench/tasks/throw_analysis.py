"""What became of a thrown cube: when it left the hand, how, and where it was going."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pytest_simbench.scene import FloatArray

FREE_FALL_TOLERANCE = 2.0
"""A released cube whose acceleration is within this of gravity flies freely [m/s^2]; engines' air
damping makes 0.1 m/s^2. The swing itself accelerates the hand by chance almost as gravity
does, so this alone does not tell a held cube from a flying one."""

OUT_OF_HAND = 0.06
"""Farther than this from the tool centre point, a cube is certainly not held [m]."""

UNCLENCHED = 0.0005
"""The fingers do not press any more when both have opened by this [m]."""


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
    time: FloatArray,
    position: FloatArray,
    velocity: FloatArray,
    tool: FloatArray,
    fingers: FloatArray,
    gravity: FloatArray,
) -> Flight | None:
    """The cube's first free flight after the hand let it go or lost it, or None.

    Args:
        time: of each sample [s], (n,), evenly spaced.
        position: of the cube [m], (n, 3).
        velocity: of the cube [m/s], (n, 3).
        tool: position of the tool centre point [m], (n, 3).
        fingers: positions of the finger joints [m], (n, 2).
        gravity: [m/s^2], (3,).
    """
    if len(time) < 3:
        return None
    gone = np.linalg.norm(position - tool, axis=1) > OUT_OF_HAND
    gone |= (fingers - fingers[0] > UNCLENCHED).all(axis=1)
    acceleration = np.diff(velocity, axis=0) / np.diff(time)[:, None]
    flying = np.linalg.norm(acceleration - gravity, axis=1) < FREE_FALL_TOLERANCE
    starts = np.flatnonzero(flying & gone[:-1])
    if not len(starts):
        return None
    first = last = int(starts[0])
    while last + 1 < len(flying) and flying[last + 1]:
        last += 1
    # flying[k] speaks of the time from sample k to k + 1
    return Flight(first, last + 1)


def landing_x(
    position: FloatArray, velocity: FloatArray, gravity: FloatArray, height: float
) -> float:
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
