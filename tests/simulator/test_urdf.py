"""The reduced robot is the original robot."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from pytest_simbench.robot.model import RobotModel
from pytest_simbench.robot.panda import panda
from pytest_simbench.scene import Pose
from pytest_simbench.simulator import DescriptionError, PreparedRobot


def test_mass_is_conserved() -> None:
    robot = panda()
    masses = [float(m.attrib["value"]) for m in ET.parse(robot.urdf).iter("mass")]
    prepared = PreparedRobot(robot)
    assert sum(link.mass for link in prepared.links.values()) == pytest.approx(sum(masses))


@pytest.mark.parametrize("base", [Pose(), Pose.at(0.3, -0.2, 0.5, yaw=0.7)])
def test_dynamics_are_those_of_the_original(base: Pose, tmp_path: Path) -> None:
    robot = panda(base=base)
    original = RobotModel(robot)
    reduced = pin.buildModelFromUrdf(str(PreparedRobot(robot).write_urdf(tmp_path)))
    data = reduced.createData()
    rng = np.random.default_rng(0)
    gravity = np.array([0.0, 0.0, -9.80665])
    reduced.gravity.linear = gravity
    for _ in range(20):
        q = np.concatenate([rng.uniform(original.lower, original.upper), [0.02, 0.02]])
        v, a = rng.normal(size=(2, 9))
        expected = original.inverse_dynamics(gravity, q[None], v[None], a[None])[0]
        rotors = robot.column("armature") * a
        assert np.allclose(pin.rnea(reduced, data, q, v, a) + rotors, expected, atol=1e-6)
        pin.forwardKinematics(reduced, data, q)
        joint = original.pin.getJointId("panda_joint7")
        pin.forwardKinematics(original.pin, original.data, q)
        there = original.base * original.data.oMi[joint]
        assert data.oMi[joint].isApprox(there, 1e-6)


def test_lines_are_short_enough_for_bullet() -> None:
    assert max(map(len, PreparedRobot(panda()).to_urdf().splitlines())) < 1000


def test_missing_file_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(DescriptionError, match="cannot read the robot description .*nowhere.urdf"):
        PreparedRobot(replace(panda(), urdf=str(tmp_path / "nowhere.urdf")))


def test_malformed_file_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "bad.urdf").write_text("<robot")
    with pytest.raises(DescriptionError, match="bad.urdf is not valid XML"):
        PreparedRobot(replace(panda(), urdf=str(tmp_path / "bad.urdf")))


def test_a_drive_for_a_joint_that_is_not_there() -> None:
    robot = panda()
    joints = (*robot.joints[:-1], replace(robot.joints[-1], name="tail"))
    with pytest.raises(DescriptionError, match="disagree about joints panda_finger_joint2, tail"):
        PreparedRobot(replace(robot, joints=joints))


def test_unknown_package() -> None:
    with pytest.raises(DescriptionError, match="unknown package 'example-robot-data'"):
        PreparedRobot(replace(panda(), packages={}))


def test_limits_are_those_of_the_original(tmp_path: Path) -> None:
    """Positions and velocities from the description, efforts from the drives."""
    robot = panda(squeeze=12.0)
    original = RobotModel(robot).pin
    reduced = pin.buildModelFromUrdf(str(PreparedRobot(robot).write_urdf(tmp_path)))
    for name in ("lowerPositionLimit", "upperPositionLimit", "velocityLimit"):
        assert np.array_equal(getattr(reduced, name), getattr(original, name))
    assert np.array_equal(reduced.effortLimit, [87.0] * 4 + [12.0] * 5)
