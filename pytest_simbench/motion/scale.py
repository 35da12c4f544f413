"""How large a robot's scenes are: the study's for arms that reach it, smaller for smaller arms.

A scene shrinks towards the world's origin: all lengths take the scale. Densities, friction and
gravity stay. So masses go with the third power. Accelerations stay with gravity, so the speeds and
times of what falls go with the square root.
"""

from __future__ import annotations

import math
from functools import cache

from pytest_simbench.motion.model import RobotModel
from pytest_simbench.scene import Robot

FULL_REACH = 0.85
"""An arm of this reach (`RobotModel.reach`) does a task where the study has it [m]: that of the
Kinova Mico2, the smallest one that was seen to. The Panda's is 1.09."""

FULL_WRIST_REACH = 0.80
"""The same for grasps from above, of the reach without the hand (`RobotModel.wrist_reach`) [m]: a
hand that points down reaches no farther. The xArm 7, the smallest one that was seen to stack in the
study's layout, has 0.82."""


@cache
def scale_of(robot: Robot) -> float:
    """All lengths of a robot's scene over those of the study's layout: in tenths, at most 1."""
    return _tenths(RobotModel(robot).reach / FULL_REACH)


@cache
def grasping_scale_of(robot: Robot) -> float:
    """The same for a scene in which cubes are grasped from above."""
    return _tenths(RobotModel(robot).wrist_reach / FULL_WRIST_REACH)


def _tenths(share: float) -> float:
    return min(10, max(1, math.floor(10.0 * share))) / 10.0
