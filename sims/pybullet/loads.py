"""What Bullet's joints transmit, from its joint sensors."""

from __future__ import annotations

import numpy as np

from pytest_simbench.scene import FloatArray, rotation_matrix
from pytest_simbench.simulator import lazy_import

pybullet = lazy_import("pybullet")


def wrench(client: int, robot: int, joint: int, subspace: FloatArray) -> FloatArray:
    """On a joint's child about the origin of its frame, in the world, (6,).

    Bullet's sensor tells it about the child's centre of mass, in the axes of its inertial frame,
    and without the motor.

    Args:
        client, robot, joint: Bullet's numbers.
        subspace: of the joint, `simulator.kinematics.motion_subspace`.
    """
    told = pybullet.getJointState(robot, joint, physicsClientId=client)
    state = pybullet.getLinkState(robot, joint, physicsClientId=client)
    inertial, link = (_turn(quaternion) for quaternion in (state[1], state[5]))
    force = inertial @ told[2][:3] + told[3] * link @ subspace[3:]
    torque = inertial @ told[2][3:] + told[3] * link @ subspace[:3]
    arm = np.subtract(state[0], state[4])
    return np.concatenate([force, torque + np.cross(arm, force)])


def _turn(quaternion: tuple[float, ...]) -> FloatArray:
    """Of Bullet's quaternions, which end with w."""
    x, y, z, w = quaternion
    return rotation_matrix(np.array([w, x, y, z]))
