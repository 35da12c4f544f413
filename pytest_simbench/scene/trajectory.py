"""A joint trajectory: what the controller is told to follow, whole, from start to end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pytest_simbench.scene.checks import SceneError, check_number
from pytest_simbench.scene.pose import FloatArray


@dataclass(frozen=True)
class Trajectory:
    """Set points of all driven joints on a regular time grid, linear in between.

    Attributes:
        tick: time between two rows [s].
        position: (n, n_joints) [rad or m]; row 0 is the set point at the start.
        velocity: (n, n_joints) [rad/s or m/s].
        effort: (n, n_joints) feed-forward from the model's inverse dynamics [N m or N].

    Raises:
        SceneError: arrays that do not fit each other, or a number that is not finite.
    """

    tick: float
    position: FloatArray
    velocity: FloatArray
    effort: FloatArray

    def __post_init__(self) -> None:
        check_number(self.tick, "the tick [s] of a trajectory", 0.0, above=True)
        arrays = (self.position, self.velocity, self.effort)
        shapes = [np.shape(rows) for rows in arrays]
        if len(set(shapes)) > 1 or len(shapes[0]) != 2 or not shapes[0][0]:
            told = ", ".join(map(str, shapes))
            raise SceneError(f"a trajectory of the shapes {told}; give 3 times (rows, joints)")
        if not all(np.isfinite(rows).all() for rows in arrays):
            raise SceneError("a trajectory holds a number that is not finite")

    @classmethod
    def holding(
        cls, tick: float, position: FloatArray, effort: FloatArray | None = None
    ) -> Trajectory:
        """One set point for one tick: joints at rest at `position`, (n_joints,), with `effort`."""
        rest = np.zeros_like(position)
        rows = (position, rest, rest if effort is None else effort)
        return cls(tick, *(np.array([row, row]) for row in rows))

    @property
    def duration(self) -> float:
        """[s], from the first row to the last."""
        return self.tick * (len(self.position) - 1)

    def resampled(self, time_step: float) -> Trajectory:
        """The set points at the end of every step of `time_step` [s]; row 0 after one step.

        The number of rows is the duration in steps, rounded, so that time ends within half a
        step of the trajectory's own end.
        """
        steps = max(1, round(self.duration / time_step))
        at = np.minimum(np.arange(1, steps + 1) * time_step, self.duration) / self.tick
        below = np.minimum(at.astype(int), len(self.position) - 1)
        above = np.minimum(below + 1, len(self.position) - 1)
        share = (at - below)[:, None]

        def sample(rows: FloatArray) -> FloatArray:
            return np.ascontiguousarray(rows[below] * (1 - share) + rows[above] * share)

        return Trajectory(
            time_step, sample(self.position), sample(self.velocity), sample(self.effort)
        )
