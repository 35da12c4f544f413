"""Can a robot grasp cubes where a task has them? Asked before anything runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pytest_simbench.robot.collision import PlanningScene
from pytest_simbench.robot.errors import Unreachable
from pytest_simbench.robot.kinematics import inverse_kinematics, tool_over, top_down_grasps
from pytest_simbench.robot.model import RobotModel
from pytest_simbench.scene import Box, Pose, Robot, Scene
from pytest_simbench.tasks.base import CUBE_SIZE
from pytest_simbench.tasks.manipulator import APPROACH

CLEARANCE = 0.005
"""Least space between an open finger and a cube [m]."""


def cannot_handle(robot: Robot, fixed: Sequence[Box], places: Sequence[Pose]) -> str | None:
    """Why a robot cannot grasp and place cubes from above at some places, in one sentence, or None.

    Args:
        robot: with its base.
        fixed: what stands in the way.
        places: of the cubes' centres.
    """
    model = RobotModel(robot)
    if not model.has_parallel_fingers:
        return f"robot {robot.name!r} has no hand with two parallel fingers to grasp a cube"
    needed = CUBE_SIZE / 2 + CLEARANCE
    if robot.gripper.opened < needed:
        return (
            f"robot {robot.name!r} opens its fingers to {robot.gripper.opened:g} m from the middle "
            f"and needs {needed:g} m for a cube of {CUBE_SIZE:g} m"
        )
    planning = PlanningScene(model, Scene("reach", tuple(fixed), robot))
    home, rng = robot.column("initial_position")[: model.arm], np.random.default_rng(0)
    for place in places:
        reason = ""
        for turned in top_down_grasps(place):
            tool = tool_over(place, turned.yaw)
            try:
                above = inverse_kinematics(model, tool.translated(z=APPROACH), home, rng)
                at = inverse_kinematics(model, tool, above)
            except Unreachable:
                reason = reason or "is out of its reach"
                continue
            touching = planning.collision(at, margin=False) or planning.collision(above)
            if touching is None:
                break
            reason = f"makes {' touch '.join(touching)}"
        else:
            x, y, z = place.position
            return (
                f"robot {robot.name!r} cannot handle a cube at ({x:.2f}, {y:.2f}, {z:.2f}): it "
                f"{reason}; place its base elsewhere"
            )
    return None
