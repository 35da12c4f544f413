"""States sampled while a world moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pytest_simbench.scene import FloatArray
from pytest_simbench.scene.policy import Observation


@dataclass(frozen=True)
class Motion:
    """States sampled during one motion or wait.

    Attributes:
        time: simulated time of each sample [s], (n,).
        joints: positions and velocities, (n, 2, n_joints).
        bodies: rows as `World.bodies`, (n, n_free, 13).
    """

    time: FloatArray
    joints: FloatArray
    bodies: FloatArray

    def __len__(self) -> int:
        return len(self.time)

    def at(self, rows: Any) -> Motion:
        """Some of the samples."""
        return Motion(self.time[rows], self.joints[rows], self.bodies[rows])

    @classmethod
    def of(cls, states: Sequence[Observation]) -> Motion:
        """The states of observations, one at least."""
        return cls(
            np.array([state.time for state in states]),
            np.array([[state.position, state.velocity] for state in states]),
            np.array([state.bodies for state in states]),
        )

    @classmethod
    def joined(cls, parts: list[Motion]) -> Motion:
        return cls(
            np.concatenate([part.time for part in parts]),
            np.concatenate([part.joints for part in parts]),
            np.concatenate([part.bodies for part in parts]),
        )
