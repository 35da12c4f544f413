"""Where the links of the reduced robot stand: forward kinematics of its description."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pytest_simbench.scene import FloatArray, Pose
from pytest_simbench.simulator.urdf import MovingJoint, PreparedRobot


def link_poses(prepared: PreparedRobot, positions: Mapping[str, float]) -> dict[str, Pose]:
    """Pose in the world of every link's frame, by name, at joint positions [rad or m]."""
    poses = {prepared.root: Pose()}
    for joint in prepared.joints:  # parents first
        moved = _motion(joint, positions[joint.name])
        poses[joint.child] = poses[joint.parent] * joint.origin * moved
    return poses


def motion_subspace(joint: MovingJoint) -> FloatArray:
    """Velocity of the joint's child at unit joint speed, (6,), in the child's own frame.

    Angular velocity first [rad/s], then the linear velocity of the frame's origin [m/s]
    (Featherstone, Rigid Body Dynamics Algorithms, section 3.5).
    """
    axis = _unit(joint)
    still = np.zeros(3)
    return np.concatenate([axis, still] if joint.kind == "revolute" else [still, axis])


def _unit(joint: MovingJoint) -> FloatArray:
    axis = np.asarray(joint.axis, dtype=float)
    return np.asarray(axis / np.linalg.norm(axis))


def _motion(joint: MovingJoint, position: float) -> Pose:
    x, y, z = (float(value) for value in _unit(joint))
    if joint.kind == "prismatic":
        return Pose((x * position, y * position, z * position))
    s = float(np.sin(position / 2))
    return Pose(quaternion=(float(np.cos(position / 2)), x * s, y * s, z * s))
