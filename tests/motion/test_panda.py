"""The Panda's drives: the squeeze is part of the scene, the same for every simulator."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import pytest

from pytest_simbench.motion.panda import panda
from pytest_simbench.tasks import Jitter, Stacking, Throwing
from pytest_simbench.tasks.base import CUBE_SIZE


@pytest.mark.parametrize("task", [Stacking(), Throwing(), Throwing().study()])
def test_a_finger_squeezes_with_25_newtons(task: Stacking | Throwing) -> None:
    """On a cube of 5 cm, by the drive's own law, which is also the drive's limit."""
    robot = task.scene(1, Jitter()).robot
    for joint in robot.joints[7:]:
        penetration = CUBE_SIZE / 2 - robot.gripper.closed
        assert joint.stiffness * penetration == pytest.approx(25.0)
        assert joint.effort_limit == 25.0
    assert robot.gripper.squeeze == 25.0
    assert robot.gripper.opened == 0.035


def test_another_squeeze_is_the_fingers_limit() -> None:
    robot = panda(squeeze=10.0)
    assert [joint.effort_limit for joint in robot.joints[7:]] == [10.0, 10.0]
    assert robot.gripper.squeeze == 10.0


def test_limits_are_the_descriptions_and_the_data_sheets() -> None:
    robot = panda()
    limits = {
        joint.get("name"): joint.find("limit").attrib  # type: ignore[union-attr]
        for joint in ET.parse(robot.urdf).getroot().iter("joint")
        if joint.find("limit") is not None
    }
    found = robot.limits
    for index, joint in enumerate(robot.joints[:7]):
        assert joint.effort_limit == float(limits[joint.name]["effort"])
        assert found.velocity[index] == float(limits[joint.name]["velocity"])
    for joint in robot.joints[7:]:
        assert found.finger_speed == float(limits[joint.name]["velocity"])
    assert found.acceleration == (15, 7.5, 10, 12.5, 15, 20, 20)
    assert found.jerk == (7500, 3750, 5000, 6250, 7500, 10000, 10000)


def test_its_drives_are_stiff_and_damped_by_a_tenth() -> None:
    arm = [(joint.stiffness, joint.damping) for joint in panda().arm_joints]
    stiffness = [4500.0, 4500.0, 3500.0, 3500.0, 2000.0, 2000.0, 2000.0]
    assert arm == [(k, k / 10) for k in stiffness]
