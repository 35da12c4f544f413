"""How hard an executed motion was on the arm: shares of its limits."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pytest_simbench.motion.model import RobotModel
from pytest_simbench.scene import Body, FloatArray

SPAN = 0.01
"""Accelerations are the change of the joints' velocities over this time [s]: the engines' steps are
1 to 4 ms, and over one step a contact would count by the length of the step."""

TIE = 1e-6
"""Of a sample. Half the span is 2.5 samples of 2 ms: 2 are taken, however the times are rounded."""


@dataclass(frozen=True)
class Strain:
    """Largest shares of the arm's limits during a motion; 1 is the limit.

    Attributes:
        torque: that the real arm's motors would need for the motion as it was executed, by inverse
            dynamics; the simulated drives themselves cannot exceed their limits.
    """

    velocity: float
    acceleration: float
    torque: float

    @property
    def largest(self) -> float:
        return max(self.velocity, self.acceleration, self.torque)


def strain(
    model: RobotModel,
    gravity: FloatArray,
    time: FloatArray,
    joints: FloatArray,
    held: Body | None = None,
    free: int = 0,
) -> Strain | None:
    """How hard a motion was on the arm; None when it is shorter than `SPAN`.

    Args:
        gravity: in the world [m/s^2], (3,).
        time: of each sample [s], (n,), evenly spaced.
        joints: positions and velocities, (n, 2, n_joints).
        held: what the hand carried,
        free: and the first sample at which it did not.
    """
    if len(time) < 2:
        return None
    samples = SPAN / 2 / float(time[1] - time[0])
    half = max(1, math.ceil(samples - 0.5 - TIE))
    if len(time) <= 2 * half:
        return None
    position, velocity = joints[:, 0, : model.arm], joints[:, 1, : model.arm]
    change = velocity[2 * half :] - velocity[: -2 * half]
    acceleration = change / (time[2 * half :] - time[: -2 * half])[:, None]
    middle = slice(half, -half)
    carried = np.arange(len(time))[middle] < free
    torque = 0.0
    for rows, body in ((carried, held), (~carried, None)):
        if rows.any():
            motion = position[middle][rows], velocity[middle][rows], acceleration[rows]
            shares = np.abs(model.effort_shares(gravity, *motion, body))
            torque = max(torque, float(shares.max()))
    return Strain(
        velocity=float((np.abs(velocity) / model.limits.column("velocity")).max()),
        acceleration=float((np.abs(acceleration) / model.limits.column("acceleration")).max()),
        torque=torque,
    )
