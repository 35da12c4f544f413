"""Forces and torques that act on a body for a time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pytest_simbench.scene.checks import LARGEST, SceneError, check_number, check_numbers
from pytest_simbench.scene.pose import FloatArray, Vector3

NONE: Vector3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Wrench:
    """A force and a torque on a free body, both constant, in the world frame.

    Attributes:
        force: at the body's centre of mass [N].
        torque: about it [N m].
        start, end: simulated times between which they act [s]; the world is loaded at 0.

    Raises:
        SceneError: a number that is none, or an end that is not after the start.
    """

    force: Vector3 = NONE
    torque: Vector3 = NONE
    start: float = 0.0
    end: float = LARGEST

    def __post_init__(self) -> None:
        check_numbers(self.force, 3, "the force [N] of a wrench")
        check_numbers(self.torque, 3, "the torque [N m] of a wrench")
        check_number(self.start, "the start [s] of a wrench", 0.0)
        check_number(self.end, "the end [s] of a wrench", 0.0)
        if self.end <= self.start:
            raise SceneError(f"a wrench starts at {self.start} s and ends at {self.end} s")

    def mean(self, begin: float, end: float) -> FloatArray:
        """Force and torque between two times [s], in the mean, (6,) [N, N m].

        A time step in which a wrench starts or ends has its share: whatever the step, a wrench
        gives a body the momentum force times (end - start).
        """
        share = max(0.0, min(end, self.end) - max(begin, self.start)) / (end - begin)
        return share * np.array([*self.force, *self.torque])

    def to_wire(self) -> dict[str, Any]:
        return {**vars(self), "force": list(self.force), "torque": list(self.torque)}

    @classmethod
    def from_wire(cls, data: dict[str, Any]) -> Wrench:
        return cls(**{**data, "force": tuple(data["force"]), "torque": tuple(data["torque"])})
