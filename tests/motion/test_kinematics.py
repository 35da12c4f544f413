"""Inverse kinematics inverts, and reaches everything the study needs."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_simbench.motion.errors import Unreachable
from pytest_simbench.motion.kinematics import (
    inverse_kinematics,
    straight_line,
    tool_over,
    tool_path,
    top_down_grasps,
)
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.panda import READY as AT_READY
from pytest_simbench.motion.panda import panda
from pytest_simbench.motion.registry import find
from pytest_simbench.scene import Pose
from pytest_simbench.tasks.stacking import GRID, TABLE_TOP, TOWERS

MODEL, READY = RobotModel(panda()), np.array(AT_READY)
PLACES = [(x, y, TABLE_TOP + 0.025) for x, y in GRID] + [
    (x, y, TABLE_TOP + 0.05 * (level + 0.5)) for (x, y), level in product(TOWERS, range(5))
]


@pytest.mark.parametrize("height", [0.0, 0.10], ids=["at", "above"])
def test_every_pose_of_the_study_is_reachable(height: float) -> None:
    for place in PLACES:
        for tool in top_down_grasps(Pose.at(*place).translated(z=height)):
            q = inverse_kinematics(MODEL, tool, READY, np.random.default_rng(0))
            assert np.allclose(MODEL.tool_pose(q).matrix(), tool.matrix(), atol=1e-5)


@given(st.lists(st.floats(0.05, 0.95), min_size=7, max_size=7))
@settings(max_examples=50, deadline=None)
def test_forward_kinematics_inverts_it(shares: list[float]) -> None:
    q = MODEL.lower + np.array(shares) * (MODEL.upper - MODEL.lower)
    target = MODEL.tool_pose(q)
    found = inverse_kinematics(MODEL, target, np.clip(q + 0.05, MODEL.lower, MODEL.upper))
    assert np.allclose(MODEL.tool_pose(found).matrix(), target.matrix(), atol=1e-5)
    assert (found >= MODEL.lower).all()
    assert (found <= MODEL.upper).all()


@pytest.mark.parametrize("yaw", [-0.5, 0.0, 0.7, 2.0])
def test_five_joints_point_a_tool_down_with_any_yaw(yaw: float) -> None:
    """Its description is written with 6 digits, so the arm of the SO-101 tilts by 1e-5 rad."""
    robot = find("so101")
    model = RobotModel(robot)
    tool = tool_over(Pose.at(0.2, 0.05, 0.03), yaw)
    near = model.home
    found = model.tool_pose(inverse_kinematics(model, tool, near, np.random.default_rng(0)))
    assert found.position == pytest.approx(tool.position, abs=1e-6)
    assert np.allclose(found.matrix(), tool.matrix(), atol=1e-4)


def test_five_joints_cannot_turn_a_tool_as_they_like() -> None:
    """Sideways out of the upright plane of the arm."""
    model = RobotModel(find("so101"))
    sideways = tool_over(Pose.at(0.2, 0.0, 0.1), 0.0) * Pose(quaternion=(0.9, 0.19**0.5, 0, 0))
    with pytest.raises(Unreachable):
        inverse_kinematics(model, sideways, np.zeros(5), np.random.default_rng(0), restarts=3)


def test_out_of_reach_says_where() -> None:
    with pytest.raises(Unreachable, match=r"unreachable: tool at \(2.000, 0.000, 0.300\)"):
        inverse_kinematics(MODEL, tool_over(Pose.at(2, 0, 0.3), 0.0), READY)


def test_grasps_follow_the_yaw_of_a_cube_on_any_face() -> None:
    flipped = Pose.at(0.4, 0.1, 0.3, yaw=0.3) * Pose(quaternion=(0.5**0.5, 0.5**0.5, 0, 0))
    for cube in (Pose.at(0.4, 0.1, 0.3, yaw=0.3), flipped):
        for tool in top_down_grasps(cube):
            closing = tool.rotation()[:, 1]
            assert np.abs(cube.rotation().T @ closing).max() == pytest.approx(1.0)
            assert np.allclose(tool.rotation()[:, 2], [0, 0, -1])


def test_a_straight_line_is_straight() -> None:
    above = inverse_kinematics(MODEL, tool_over(Pose.at(0.4, 0.1, 0.5), 0.2), READY)
    path = straight_line(MODEL, above, tool_over(Pose.at(0.4, 0.1, 0.35), 0.2))
    tips = np.array([MODEL.tool_pose(q).position for q in path])
    assert np.allclose(tips[:, :2], [0.4, 0.1], atol=1e-5)
    assert (np.diff(tips[:, 2]) < 0).all()


def test_a_path_goes_through_its_poses() -> None:
    start = inverse_kinematics(MODEL, tool_over(Pose.at(0.4, 0.0, 0.3), 0.0), READY)
    poses = [tool_over(Pose.at(0.4, 0.01 * k, 0.3), 0.05 * k) for k in range(1, 12)]
    path = tool_path(MODEL, start, poses)
    assert np.array_equal(path[0], start)
    for q, pose in zip(path[1:], poses, strict=True):
        assert np.allclose(MODEL.tool_pose(q).matrix(), pose.matrix(), atol=1e-5)


@pytest.mark.parametrize(
    ("end", "message"),
    [
        (tool_over(Pose.at(1.5, 0.0, 0.3), 0.0), r"^unreachable: path to \(1.5, 0.0, 0.3\)$"),
        (tool_over(Pose.at(0.4, 0.0, 0.3), 1.0), "^unreachable: the path needs a jump of the arm"),
    ],
    ids=["too far", "jump"],
)
def test_a_path_that_cannot_be_followed_says_so(end: Pose, message: str) -> None:
    start = inverse_kinematics(MODEL, tool_over(Pose.at(0.4, 0.0, 0.3), 0.0), READY)
    with pytest.raises(Unreachable, match=message):
        tool_path(MODEL, start, [end])
