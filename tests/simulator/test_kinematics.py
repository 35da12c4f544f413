"""Link poses and joint axes agree with Pinocchio, which reads the original description."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from pytest_simbench.robot.model import RobotModel
from pytest_simbench.robot.panda import panda
from pytest_simbench.scene import Pose
from pytest_simbench.simulator import PreparedRobot
from pytest_simbench.simulator.links import link_poses, motion_subspace

ROBOT = panda(base=Pose.at(0.2, -0.1, 0.3, yaw=0.7))
PREPARED, MODEL = PreparedRobot(ROBOT), RobotModel(ROBOT)


@pytest.mark.parametrize("seed", range(3))
def test_poses_are_pinocchios(seed: int) -> None:
    q = np.random.default_rng(seed).uniform(-1.0, 1.0, len(ROBOT.joints))
    poses = link_poses(PREPARED, dict(zip(ROBOT.joint_names, q, strict=True)))
    data = MODEL.pin.createData()
    pin.forwardKinematics(MODEL.pin, data, q)
    for joint in PREPARED.joints:
        placement = MODEL.base * data.oMi[MODEL.pin.getJointId(joint.name)]
        np.testing.assert_allclose(poses[joint.child].matrix(), placement.homogeneous, atol=1e-9)


def test_axes_are_pinocchios() -> None:
    q = np.random.default_rng(0).uniform(-1.0, 1.0, len(ROBOT.joints))
    data = MODEL.pin.createData()
    for joint in PREPARED.joints:
        index = MODEL.pin.getJointId(joint.name)
        jacobian = pin.computeJointJacobian(MODEL.pin, data, q, index)
        column = jacobian[:, MODEL.pin.joints[index].idx_v]  # linear before angular
        np.testing.assert_allclose(
            motion_subspace(joint), np.concatenate([column[3:], column[:3]]), atol=1e-12
        )
