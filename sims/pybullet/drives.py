"""Bullet's own position motors as drives: velocity constraints whose largest force is the effort
limit.

Each step h they ask for the velocity v + `velocityGain` (v* - v) + `positionGain` (q* - q) / h.
Where no gain is set they are told what makes it that at which the scene's drive law
(`scene.Joint`) asks for no effort at the end of the step, (k (q* - q) + d v*) / (h k + d): they are
that law, infinitely stiff at the same k / d. A higher rate, as of a gain of 0.3 (72/s against
k / d = 10/s), brakes too late once the effort saturates: joint 1 of the Panda goes 53 % of its way
too far. Bullet clips q* to the joint's limits, which the law does not: v* makes up for it.

Two fingers have a gain of their own. Told apart, both motors must come to their limits before the
gear between them gets its way, and at the law's rate (25/s) 50 iterations bring them to 14 of 25 N:
they stay 16.5 mm apart.
"""

from __future__ import annotations

import math

import numpy as np

from pytest_simbench.scene import FloatArray, Robot
from pytest_simbench.simulator import lazy_import

from .settings import PyBulletSettings

pybullet = lazy_import("pybullet")

WEAKEST = 1e-9
"""Least resistance h k + d of a drive [N m s/rad or N s/m]: a joint may have neither."""


class Drives:
    """Of all joints that move.

    Args:
        client, number: Bullet's numbers of the client and the robot.
        joints: Bullet's numbers, in the order of the robot's.
        robot: has their drives.
        settings: have the gains.

    Attributes:
        gains: `positionGain` and `velocityGain` of each joint.
    """

    def __init__(
        self, client: int, number: int, joints: list[int], robot: Robot, settings: PyBulletSettings
    ) -> None:
        self._client, self._number, self._joints = client, number, joints
        self._forces = [0.0 if joint.motor else joint.effort_limit for joint in robot.joints]
        n, step, gain = len(joints), settings.timestep, settings.position_gain
        k, d = robot.column("stiffness"), robot.column("damping")
        self._share = np.ones(n) if gain is not None else d / np.maximum(step * k + d, WEAKEST)
        coupled = robot.finger_indices if robot.gripper.couplings else []
        self._share[coupled] = 1.0
        self._rate = (1 - self._share) / step
        gains = 1 - self._share if gain is None else np.full(n, gain)
        gains[coupled] = settings.finger_gain
        self.gains = gains, np.full(n, settings.velocity_gain)
        infos = [pybullet.getJointInfo(number, joint, physicsClientId=client) for joint in joints]
        self._limits = np.array([info[8:10] for info in infos]).reshape(-1, 2).T
        self._limits[:, self._limits[0] > self._limits[1]] = [[-math.inf], [math.inf]]

    def command(self, position: FloatArray, velocity: FloatArray) -> None:
        """What the drives are told from now on."""
        beyond = position - np.clip(position, *self._limits)
        pybullet.setJointMotorControlArray(
            self._number,
            self._joints,
            pybullet.POSITION_CONTROL,
            position,
            self._share * velocity + self._rate * beyond,
            self._forces,
            *self.gains,
            physicsClientId=self._client,
        )
