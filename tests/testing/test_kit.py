"""The robot of the kit: ids, laws that are skipped, laws that are about no robot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pytest_simbench.sims.mujoco.adapter import MuJoCo

from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.registry import BUILT_IN, find
from pytest_simbench.testing import CHECKS, ConformanceTest, ConformanceWarning, Subject
from pytest_simbench.testing.checks import any_robot, coupled, grasping
from pytest_simbench.testing.faults import robot_faults
from pytest_simbench.testing.kit import Kit, conformance_checks
from pytest_simbench.testing.scenes import at_random, lifted
from pytest_simbench.testing.touch import approaches, beside, link_clouds

LAWS = ("free_fall", "static_hold", "grip_holds", "fingers_stay_coupled")
KIT = Kit((Subject(MuJoCo),), LAWS, {})


def test_the_panda_adds_nothing_to_ids() -> None:
    assert [test.id for test in KIT.tests([None])] == [f"mujoco-tuned-{law}" for law in LAWS]


def test_other_robots_do_and_a_law_about_no_robot_is_one_test() -> None:
    ids = [test.id for test in KIT.tests([find("ur5"), find("so101")])]
    assert ids[:3] == [
        "mujoco-tuned-free_fall",
        "mujoco-tuned-ur5-static_hold",
        "mujoco-tuned-so101-static_hold",
    ]
    assert len(ids) == 1 + 2 * 3


def test_what_a_hand_cannot_do_is_skipped_with_the_reason() -> None:
    ur5, so101 = find("ur5"), find("so101")
    narrow = replace(ur5, gripper=replace(ur5.gripper, opened=0.03))
    assert {law(ur5) for law in (any_robot, coupled, grasping)} == {None}
    assert any_robot(so101) is None
    assert grasping(narrow) == "ur5 opens its fingers to 0.03 m; the law takes 0.035 m"
    for law, reason in (
        ("grip_holds", "so101 has no hand with two parallel fingers"),
        ("fingers_stay_coupled", "so101 has 1 finger joints: none is coupled"),
    ):
        with pytest.raises(pytest.skip.Exception, match=reason):
            ConformanceTest(Subject(MuJoCo, robot=so101), CHECKS[law])()


def test_expected_failures_of_known_robots_match() -> None:
    conformance_checks("mujoco", expected_failures={"mujoco-tuned-ur5-static_hold": "soft"})
    with pytest.warns(ConformanceWarning, match="matches no check"):
        conformance_checks("mujoco", expected_failures={"mujoco-tuned-ur6-static_hold": "soft"})


def test_the_robot_of_the_command_line(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
from pytest_simbench.testing import conformance_checks

@conformance_checks("mujoco", only=["free_fall", "weak_joint_sags", "grip_holds"])
def test_conformance(check):
    check()
"""
    )
    result = pytester.runpytest_subprocess("-v", "-rs", "--robot", "so101")
    result.stdout.fnmatch_lines_random(
        [
            "*test_conformance?mujoco-tuned-free_fall? PASSED*",
            "*test_conformance?mujoco-tuned-so101-weak_joint_sags? PASSED*",
            "*SKIPPED*so101 has no hand with two parallel fingers*",
        ]
    )
    result.assert_outcomes(passed=2, skipped=1)


@pytest.mark.parametrize("name", BUILT_IN)
def test_a_cube_reaches_every_link_that_moves(name: str) -> None:
    robot = find(name)
    reached = [approach.link for _, group in approaches(robot) for approach in group]
    assert sorted(reached) == sorted(link_clouds(robot).keys() - {"base"})


@pytest.mark.parametrize("name", BUILT_IN)
def test_lifted_robots_touch_no_ground(name: str) -> None:
    rng = np.random.default_rng(1)
    for _ in range(5):
        clouds = link_clouds(at_random(lifted(find(name)), rng))
        assert min(cloud[:, 2].min() for cloud in clouds.values()) > 0.1


def test_places_beside_a_robot_are_clear() -> None:
    robot = find("ur10")
    assert beside(robot, 0.7, 0.0) == (0.7, 0.0)
    (x, y), clouds = beside(robot, -0.3, 0.0), link_clouds(robot).values()
    assert x < -0.3
    assert y == 0.0
    for cloud in clouds:
        assert x < cloud[:, 0].min() or not cloud[:, 1].min() < y < cloud[:, 1].max()


@pytest.mark.parametrize("name", [name for name in BUILT_IN if name != "panda"])
def test_faults_of_a_robot_concern_one_quantity_each(name: str) -> None:
    robot = find(name)
    faults = robot_faults(robot)
    quantities = [fault.quantity for fault in faults.values()]
    assert len(set(quantities)) == len(quantities) == 15
    joints = {quantity.split("/")[1] for quantity in quantities if quantity.startswith("joint/")}
    assert joints <= set(RobotModel(robot).robot.joint_names)
