"""What PhysX's joints transmit."""

from __future__ import annotations

import numpy as np

from pytest_simbench.scene import FloatArray, Pose
from pytest_simbench.simulator import PreparedRobot
from pytest_simbench.simulator.kinematics import link_poses

from . import usd_text as usd


def wrenches(told: FloatArray, prepared: PreparedRobot, positions: FloatArray) -> FloatArray:
    """Of the driven joints, on the links below about their origins, in the world, (n_joints, 6).

    Args:
        told: by PhysX of each link by its number in `prepared.links`, (n_links, 6), in the axes of
            the frame of the joint above it, whose x is the joint's axis.
        prepared: whose joints they are.
        positions: of the joints, (n_joints,).
    """
    names = prepared.robot.joint_names
    poses = link_poses(prepared, dict(zip(names, positions, strict=True)))
    numbers = {name: k for k, name in enumerate(prepared.links)}
    joints = {joint.name: joint for joint in prepared.joints}
    rows = []
    for joint in (joints[name] for name in names):
        axes = Pose(quaternion=usd.turn_from_x(np.asarray(joint.axis)))
        turn = (poses[joint.child] * axes).rotation()
        rows.append((told[numbers[joint.child]].reshape(2, 3) @ turn.T).ravel())
    return np.array(rows).reshape(-1, 6)
