"""Joint paths along measured motions of the tool."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from pytest_simbench.robot.model import RobotModel
from pytest_simbench.scene import FloatArray, Pose

POSITION, ROTATION, POSTURE, STEP = 100.0, 0.3, 0.1, 1e-5
"""Weights of 1 m of position, 1 rad of rotation, 1 rad of posture, and 1 rad from the solution
before, which chooses among those of an arm with more joints than it needs. The position is met to a
micrometre. The other two share what is left: near a singularity (a stretched wrist) a hundredth of
a degree of rotation costs tens of degrees in the joints."""


def track(
    model: RobotModel, targets: Sequence[Pose], near: FloatArray, held: Sequence[int] = ()
) -> FloatArray:
    """Arm joints that bring the tool to each target, each solution near the one before, (n, arm).

    Args:
        targets: tool poses, close to one another.
        near: where the search for the first one starts (arm,) [rad].
        held: numbers of joints that were commanded to stay at 0, and are kept near it.
    """
    path = np.empty((len(targets), model.arm))
    joints, indices = np.asarray(near, dtype=float), list(held)
    for row, target in zip(path, targets, strict=True):
        inverse = target.inverse()

        def off(
            arm: FloatArray, inverse: Pose = inverse, before: FloatArray = joints
        ) -> FloatArray:
            left = inverse * model.tool_pose(arm)
            turn = 2.0 * np.sign(left.quaternion[0]) * np.array(left.quaternion[1:])
            return np.concatenate(
                [
                    POSITION * np.array(left.position),
                    ROTATION * turn,
                    POSTURE * arm[indices],
                    STEP * (arm - before),
                ]
            )

        joints = least_squares(off, joints, method="lm", xtol=1e-8, ftol=1e-8).x
        row[:] = joints
    return path
