"""How large a robot's scenes are: the study's for arms that reach it, smaller for smaller arms."""

from __future__ import annotations

import math
from functools import cache

from pytest_simbench.robot.model import RobotModel
from pytest_simbench.scene import Robot

FULL_REACH = 0.85
"""An arm of this reach (`RobotModel.reach`) does a task where the study has it [m]: that of the
Kinova Mico2, the smallest one that was seen to. The Panda's is 1.09."""


@cache
def scale_of(robot: Robot) -> float:
    """All lengths of a robot's scene over those of the study's layout: in tenths, at most 1.

    The scene shrinks towards the world's origin. Densities, friction and gravity stay; so masses go
    with the third power.
    """
    tenths = math.floor(10.0 * RobotModel(robot).reach / FULL_REACH)
    return min(10, max(1, tenths)) / 10.0
