"""Where two episodes part: the first different bit, and how far apart their cubes get."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pytest_simbench.client.motion import Motion
from pytest_simbench.records.repeatability import GROWTH_TIMES, StateDifference
from pytest_simbench.scene import FloatArray


@dataclass(frozen=True)
class Gaps:
    """Distances between the cubes of two episodes at the same moment of the same operation.

    Attributes:
        time: simulated time in the first episode [s], (n,).
        distance: between the positions of each cube [m], (n, n_free).
        position: in the first episode [m], (n, n_free, 3).
    """

    time: FloatArray
    distance: FloatArray
    position: FloatArray

    def largest(self) -> FloatArray:
        """Over the cubes [m], (n,)."""
        return np.asarray(self.distance.max(axis=1, initial=0.0))

    def first_beyond(self, limit: float) -> tuple[int, int] | None:
        """Sample and cube where a distance first exceeds `limit` [m]."""
        beyond = np.flatnonzero(self.largest() > limit)
        if not len(beyond):
            return None
        sample = int(beyond[0])
        return sample, int(self.distance[sample].argmax())

    def after(self, time: float) -> float | None:
        """The largest distance at a time, None when the episodes were over by then [m]."""
        at = int(np.searchsorted(self.time, time - 1e-9))
        return None if at >= len(self.time) else float(self.largest()[at])


def gaps(first: Sequence[Motion], second: Sequence[Motion]) -> Gaps:
    """Compare two episodes operation by operation, for as long as both lasted.

    Each operation starts its own clock, because operations last a whole number of steps and steps
    differ between simulators. Between samples the second episode is interpolated by cubics
    through positions and velocities.

    Args:
        first, second: `TapedWorld.motions` of both: the state at the start, then one motion for
            each operation.
    """
    times, distances, positions = [], [], []
    for number, (a, b) in enumerate(zip(first, second, strict=False)):
        here, time = a.bodies[:, :, :3], a.time
        if number == 0 or np.array_equal(a.time, b.time):
            there = b.bodies[: len(here), :, :3]
        else:
            clock = a.time - first[number - 1].time[-1]
            before = second[number - 1]
            until = b.time[-1] - before.time[-1]
            both = clock <= until + 1e-9
            here, time, there = here[both], time[both], _at(clock[both], before, b)
        times.append(time)
        distances.append(np.linalg.norm(here - there, axis=2))
        positions.append(here)
    return Gaps(np.concatenate(times), np.concatenate(distances), np.concatenate(positions))


def _at(clock: FloatArray, before: Motion, motion: Motion) -> FloatArray:
    """Positions of the cubes so long after the operation began, (n, n_free, 3)."""
    from scipy.interpolate import CubicHermiteSpline

    start = before.time[-1]
    time = np.concatenate([[0.0], motion.time - start])
    states = np.concatenate([before.bodies[-1:], motion.bodies])
    spline = CubicHermiteSpline(time, states[:, :, :3], states[:, :, 7:10], axis=0)
    return np.asarray(spline(np.minimum(clock, time[-1])))


def difference(
    first: Sequence[Motion], second: Sequence[Motion], bodies: Sequence[str]
) -> StateDifference:
    """How two runs in one simulator part, sampled bit by bit.

    Args:
        first, second: `TapedWorld.motions` of both.
    """
    found = _first_difference(first, second)
    if found is None:
        return StateDifference()
    time, body = found
    between = gaps(first, second)
    return StateDifference(
        first=time,
        body="" if body is None else bodies[body],
        growth={after: between.after(time + float(after)) for after in GROWTH_TIMES},
        largest=float(between.largest().max(initial=0.0)),
    )


def _first_difference(
    first: Sequence[Motion], second: Sequence[Motion]
) -> tuple[float, int | None] | None:
    for number, (a, b) in enumerate(zip(first, second, strict=False)):
        if a.bodies.shape != b.bodies.shape:
            return float(first[max(0, number - 1)].time[-1]), None
        bodies = (_bits(a.bodies) != _bits(b.bodies)).any(axis=2)
        joints = (_bits(a.joints) != _bits(b.joints)).reshape(len(a), -1).any(axis=1)
        differs = bodies.any(axis=1) | joints | (_bits(a.time) != _bits(b.time))
        if differs.any():
            sample = int(differs.argmax())
            body = int(bodies[sample].argmax()) if bodies[sample].any() else None
            return float(a.time[sample]), body
    if len(first) != len(second):
        shorter = min(first, second, key=len)
        return float(shorter[-1].time[-1]), None
    return None


def _bits(values: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.uint64]]:
    """The bit patterns, so that 0 and -0 differ and not-a-number equals itself."""
    return np.ascontiguousarray(values, dtype=np.float64).view(np.uint64)
