"""Scenes are the study's for arms that reach it, and shrink with the arm."""

from __future__ import annotations

import pytest

from pytest_simbench.robot.model import RobotModel
from pytest_simbench.robot.registry import find
from pytest_simbench.robot.scale import FULL_WRIST_REACH, grasping_scale_of, scale_of


@pytest.mark.parametrize("name", ["panda", "ur5", "ur10", "xarm7"])
def test_arms_of_full_reach_have_the_studys_scene(name: str) -> None:
    assert scale_of(find(name)) == grasping_scale_of(find(name)) == 1.0


def test_the_so101_has_a_smaller_one() -> None:
    robot = find("so101")
    assert (scale_of(robot), grasping_scale_of(robot)) == (0.5, 0.4)
    reach = RobotModel(robot).wrist_reach
    assert reach == pytest.approx(0.379, abs=1e-3)  # of the URDF
    assert 0.4 <= reach / FULL_WRIST_REACH < 0.5


def test_the_hand_is_what_reach_has_and_wrist_reach_has_not() -> None:
    for name in ("panda", "so101"):
        model = RobotModel(find(name))
        hand = model.pin.frames[model.tool].placement.translation
        assert model.reach - model.wrist_reach == pytest.approx(float((hand**2).sum() ** 0.5))
