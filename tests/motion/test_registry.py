"""Which robots are known, how large their scenes are, and how hard the Panda squeezes."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import pytest

from pytest_simbench.motion import registry
from pytest_simbench.motion.errors import RobotError
from pytest_simbench.motion.model import FULL_WRIST_REACH, RobotModel, grasping_scale_of, scale_of
from pytest_simbench.motion.panda import panda
from pytest_simbench.motion.registry import find
from pytest_simbench.tasks import Jitter, Stacking, Throwing
from pytest_simbench.tasks.base import CUBE_SIZE

MODULE = """
from dataclasses import replace
from pytest_simbench.motion.panda import panda

def mine():
    return replace(panda(), name="mine")

def breaks():
    raise SystemExit(3)

def nothing():
    return None

def stops():
    raise KeyboardInterrupt
"""
ENTRIES = """[pytest_simbench.robots]
mine = my_robots:mine
other = my_robots:mine
breaks = my_robots:breaks
nothing = my_robots:nothing
stops = my_robots:stops
absent = my_robots:absent
"""


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    (tmp_path / "my_robots.py").write_text(MODULE)
    metadata = tmp_path / "my_robots-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: my-robots\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text(ENTRIES)
    monkeypatch.syspath_prepend(tmp_path)
    for cached in (registry._registered, registry.known_robot):
        cached.cache_clear()
    yield
    for cached in (registry._registered, registry.known_robot):
        cached.cache_clear()


@pytest.mark.usefixtures("package")
def test_a_package_registers_a_robot() -> None:
    assert registry.known()[:5] == ["panda", "so101", "ur10", "ur5", "xarm7"]
    assert "mine" in registry.known()
    assert registry.find("mine").name == "mine"
    with pytest.raises(KeyboardInterrupt):
        registry.find("stops")


@pytest.mark.usefixtures("package")
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("other", r"the robot 'other' \(my_robots:mine\) calls itself 'mine'"),
        ("breaks", r"the robot 'breaks' \(my_robots:breaks\) cannot be made: SystemExit: 3"),
        ("nothing", r"the robot 'nothing' .* is NoneType, no pytest_simbench\.scene\.Robot"),
        ("absent", r"the robot 'absent' .* cannot be made: AttributeError: .*absent"),
    ],
)
def test_a_broken_one_is_a_sentence(name: str, message: str) -> None:
    with pytest.raises(RobotError, match=message):
        registry.find(name)


def test_the_so101_has_a_smaller_one() -> None:
    robot = find("so101")
    assert (scale_of(robot), grasping_scale_of(robot)) == (0.5, 0.4)
    reach = RobotModel(robot).wrist_reach
    assert reach == pytest.approx(0.379, abs=1e-3)  # of the URDF
    assert 0.4 <= reach / FULL_WRIST_REACH < 0.5


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
