"""Time-parametrisation of joint paths at the robot's limits, by Ruckig."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import ruckig
from scipy.interpolate import CubicSpline

from pytest_simbench.robot.panda import ACCELERATION_LIMITS, JERK_LIMITS, VELOCITY_LIMITS
from pytest_simbench.scene import FloatArray

TICK = 0.004
"""Time between two set points [s]."""


@dataclass(frozen=True)
class Timed:
    """Arm motion on a grid of `TICK`: position, velocity, acceleration, each (n, arm)."""

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray

    @property
    def duration(self) -> float:
        """[s]."""
        return TICK * (len(self.position) - 1)


def point_to_point(
    start: FloatArray, goal: FloatArray, *, speed: float = 1.0, straight: bool = True
) -> tuple[Timed, float]:
    """From rest to rest; the motion, whose last row is the goal, and its exact duration [s].

    Args:
        start, goal: arm joints, (arm,) [rad].
        speed: share of the velocity limits; acceleration scales with its square root's square,
            jerk with its cube, which stretches time by 1 / speed.
        straight: keep to the straight line in joint space (phase synchronisation); otherwise
            joints only start and end together.
    """
    sync = ruckig.Synchronization.Phase if straight else ruckig.Synchronization.Time
    trajectory = _plan(
        start,
        goal,
        VELOCITY_LIMITS * speed,
        ACCELERATION_LIMITS * speed**2,
        JERK_LIMITS * speed**3,
        sync,
    )
    duration = float(trajectory.duration)
    times = np.minimum(TICK * np.arange(int(np.ceil(duration / TICK - 1e-9)) + 1), duration)
    samples = [trajectory.at_time(float(t)) for t in times]
    position, velocity, acceleration = (
        np.array([sample[i] for sample in samples]) for i in range(3)
    )
    return Timed(position, velocity, acceleration), duration


def along_path(path: FloatArray, *, speed: float = 1.0) -> Timed:
    """From rest to rest along a smooth path, within all joint limits.

    A cubic spline goes through the way points; one Ruckig profile runs along its arc length with
    bounds that hold the joint limits everywhere, and the result is checked on every sample.

    Args:
        path: way points, (n, arm) [rad], n >= 2.
        speed: share of the velocity limits, as in `point_to_point`.
    """
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    keep = np.concatenate([[True], np.diff(length) > 1e-9])
    length, path = length[keep], path[keep]
    if len(path) < 2:
        return Timed(path[:1], np.zeros_like(path[:1]), np.zeros_like(path[:1]))
    spline = CubicSpline(length, path)
    dense = np.linspace(0.0, length[-1], 10 * len(path))
    first, second = (np.abs(spline(dense, order)).max(axis=0) + 1e-9 for order in (1, 2))
    velocity = min((VELOCITY_LIMITS / first).min(), np.sqrt(ACCELERATION_LIMITS / 2 / second).min())
    acceleration = (ACCELERATION_LIMITS / 2 / first).min()
    jerk = (JERK_LIMITS / 4 / first).min()
    limits = np.array([[velocity * speed], [acceleration * speed**2], [jerk * speed**3]])
    for _ in range(5):
        timed = _along(spline, float(length[-1]), limits)
        excess = max(
            (np.abs(timed.velocity) / VELOCITY_LIMITS).max(),
            np.sqrt((np.abs(timed.acceleration) / ACCELERATION_LIMITS).max()),
        )
        if excess <= 1.0:
            return timed
        slower = 1.0 / (1.01 * excess)
        limits = limits * np.array([[slower], [slower**2], [slower**3]])
    return timed


def _along(spline: CubicSpline, length: float, limits: FloatArray) -> Timed:
    profile = _plan(np.zeros(1), np.array([length]), *limits, ruckig.Synchronization.Time)
    duration = float(profile.duration)
    times = np.minimum(TICK * np.arange(int(np.ceil(duration / TICK - 1e-9)) + 1), duration)
    s, ds, dds = np.array([[value[0] for value in profile.at_time(float(t))[:3]] for t in times]).T
    d1, d2 = spline(s, 1), spline(s, 2)
    return Timed(spline(s), d1 * ds[:, None], d2 * (ds**2)[:, None] + d1 * dds[:, None])


def _plan(
    start: FloatArray,
    goal: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    jerk: FloatArray,
    synchronization: ruckig.Synchronization,
) -> ruckig.Trajectory:
    request = ruckig.InputParameter(len(start))
    request.current_position, request.target_position = list(start), list(goal)
    request.max_velocity, request.max_acceleration = list(velocity), list(acceleration)
    request.max_jerk, request.synchronization = list(jerk), synchronization
    trajectory = ruckig.Trajectory(len(start))
    result = ruckig.Ruckig(len(start)).calculate(request, trajectory)
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise ValueError(f"Ruckig cannot time a motion from {start} to {goal}: {result}")
    return trajectory
