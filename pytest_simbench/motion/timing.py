"""Time-parametrisation of joint paths at the robot's limits, by Ruckig."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import ruckig
from scipy.interpolate import CubicSpline

from pytest_simbench.motion.errors import PlanningError
from pytest_simbench.scene import FloatArray, MotionLimits

TICK = 0.004
"""Time between two set points [s]."""


class Timed(NamedTuple):
    """Arm motion on a grid of `TICK`: position, velocity, acceleration, each (n, arm)."""

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray

    @property
    def duration(self) -> float:
        """[s]."""
        return TICK * (len(self.position) - 1)


def straight_move(
    start: FloatArray, goal: FloatArray, limits: MotionLimits, *, speed: float
) -> Timed:
    """From rest to rest on the straight line in joint space; its last row is the goal.

    Args:
        start, goal: arm joints, (arm,) [rad].
        speed: share of the velocity limits (`_shares`).
    """
    return line_move(start, goal, limits, _shares(speed))[0]


def line_move(
    start: FloatArray,
    goal: FloatArray,
    limits: MotionLimits,
    shares: tuple[float, float, float],
) -> tuple[Timed, float]:
    """The same with shares of the velocity, acceleration and jerk limits; also the exact duration
    [s], which the rows round up to a whole number of ticks.

    One Ruckig profile runs along the line with the bounds that hold every joint's limits. Ruckig's
    own phase synchronisation falls back to another path where it finds none; a quarter of random
    moves then left the line by up to 0.04 rad, enough to knock over a tower.
    """
    way = np.asarray(goal) - np.asarray(start)
    reach = np.maximum(np.abs(way), 1e-9)
    bounds = [
        np.array([(bound / reach).min() * share])
        for bound, share in zip(_bounds(limits), shares, strict=True)
    ]
    profile = _plan(np.zeros(1), np.ones(1), *bounds)
    s, ds, dds = _sampled(profile)
    return Timed(np.asarray(start) + s * way, ds * way, dds * way), float(profile.duration)


def synchronised_move(
    start: FloatArray, goal: FloatArray, limits: MotionLimits
) -> tuple[Timed, float]:
    """From rest to rest at full speed, joints only starting and ending together; also the exact
    duration [s], which the rows round up to a whole number of ticks."""
    trajectory = _plan(start, goal, *_bounds(limits))
    return Timed(*_sampled(trajectory)), float(trajectory.duration)


def along_path(path: FloatArray, limits: MotionLimits, *, speed: float = 1.0) -> Timed:
    """From rest to rest along a smooth path, within all joint limits.

    A cubic spline goes through the way points; one Ruckig profile runs along its arc length with
    bounds that hold the joint limits everywhere, and the result is checked on every sample.

    Args:
        path: way points, (n, arm) [rad], n >= 2.
        speed: share of the velocity limits (`_shares`).
    """
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    keep = np.concatenate([[True], np.diff(length) > 1e-9])
    length, path = length[keep], path[keep]
    if len(path) < 2:
        return Timed(path[:1], np.zeros_like(path[:1]), np.zeros_like(path[:1]))
    spline = CubicSpline(length, path)
    dense = np.linspace(0.0, length[-1], 10 * len(path))
    first, second = (np.abs(spline(dense, order)).max(axis=0) + 1e-9 for order in (1, 2))
    velocities, accelerations, jerks = _bounds(limits)
    velocity = min((velocities / first).min(), np.sqrt(accelerations / 2 / second).min())
    acceleration = (accelerations / 2 / first).min()
    jerk = (jerks / 4 / first).min()
    bounds = np.array([[velocity], [acceleration], [jerk]]) * np.array([_shares(speed)]).T
    for _ in range(5):
        timed = _along(spline, float(length[-1]), bounds)
        excess = max(
            (np.abs(timed.velocity) / velocities).max(),
            np.sqrt((np.abs(timed.acceleration) / accelerations).max()),
        )
        if excess <= 1.0:
            return timed
        slower = 1.0 / (1.01 * excess)
        bounds = bounds * np.array([[slower], [slower**2], [slower**3]])
    return timed


def _shares(speed: float) -> tuple[float, float, float]:
    """Of velocity, acceleration and jerk: 1 / speed stretches time. Raises `PlanningError`."""
    if not 0.0 < speed <= 1.0:
        raise PlanningError(f"the speed is {speed:g}; give a share of the limits, above 0 to 1")
    return speed, speed**2, speed**3


def _bounds(limits: MotionLimits) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Velocity, acceleration and jerk limits of the joints, each (arm,)."""
    return limits.column("velocity"), limits.column("acceleration"), limits.column("jerk")


def _along(spline: CubicSpline, length: float, bounds: FloatArray) -> Timed:
    s, ds, dds = _sampled(_plan(np.zeros(1), np.array([length]), *bounds))
    d1, d2 = spline(s[:, 0], 1), spline(s[:, 0], 2)
    return Timed(spline(s[:, 0]), d1 * ds, d2 * ds**2 + d1 * dds)


def _sampled(trajectory: ruckig.Trajectory) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Position, velocity and acceleration at every tick and at the end, each (n, joints)."""
    duration = float(trajectory.duration)
    times = np.minimum(TICK * np.arange(int(np.ceil(duration / TICK - 1e-9)) + 1), duration)
    samples = [trajectory.at_time(float(t)) for t in times]
    position, velocity, acceleration = (np.array([row[i] for row in samples]) for i in range(3))
    return position, velocity, acceleration


def _plan(
    start: FloatArray,
    goal: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    jerk: FloatArray,
) -> ruckig.Trajectory:
    """Time-optimal motion from rest to rest, all joints arriving together."""
    request = ruckig.InputParameter(len(start))
    request.current_position, request.target_position = list(start), list(goal)
    request.max_velocity, request.max_acceleration = list(velocity), list(acceleration)
    request.max_jerk = list(jerk)
    trajectory = ruckig.Trajectory(len(start))
    result = ruckig.Ruckig(len(start)).calculate(request, trajectory)
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise ValueError(f"Ruckig cannot time a motion from {start} to {goal}: {result}")
    return trajectory
