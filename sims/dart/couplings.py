"""Joints of a robot that move together, beside its fingers.

DART's own coupler lets the follower trail by 2.5 steps, and throws one whose inertia, times the
square of the ratio, exceeds the leader's. So impulses on both joints, before each step, bring them
together at its end, with the masses and accelerations that DART tells.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pytest_simbench.scene import Coupling


class Couplings:
    """Holds q_follower - ratio q_leader at the offset."""

    def __init__(self, skeleton: Any, names: Sequence[str], pairs: Sequence[Coupling]) -> None:
        self._skeleton = skeleton
        self._rows = np.zeros((len(pairs), len(names)))
        for row, pair in zip(self._rows, pairs, strict=True):
            row[names.index(pair.follower)], row[names.index(pair.leader)] = 1.0, -pair.ratio
        self._offsets = np.array([pair.offset for pair in pairs])

    def push(self) -> None:
        """For the next step. Motors and contacts act later in it, so what they do to one joint the
        other one feels in the step after."""
        s, rows = self._skeleton, self._rows
        s.computeForwardDynamics()
        step, v = s.getTimeStep(), s.getVelocities()
        coming = s.getPositions() + step * (v + step * s.getAccelerations())
        gap = (rows @ coming - self._offsets) / step
        felt = np.linalg.solve(s.getAugMassMatrix(), rows.T)  # with springs and dampers
        impulse = np.linalg.solve(rows @ felt, -gap)
        s.setVelocities(v + np.linalg.solve(s.getMassMatrix(), rows.T @ impulse))
