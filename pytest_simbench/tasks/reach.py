"""Can a robot grasp cubes where a task has them? Asked before anything runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pytest_simbench.robot.collision import PlanningScene
from pytest_simbench.robot.errors import Unreachable
from pytest_simbench.robot.grasping import CLEARANCE, GRASP_LINK, grasp_of
from pytest_simbench.robot.kinematics import inverse_kinematics, tool_over, top_down_grasps
from pytest_simbench.robot.model import RobotModel
from pytest_simbench.scene import Box, Pose, Robot, Scene
from pytest_simbench.tasks.base import CUBE_SIZE
from pytest_simbench.tasks.manipulator import APPROACH


def cannot_handle(
    robot: Robot, fixed: Sequence[Box], places: Sequence[Pose], scale: float = 1.0
) -> str | None:
    """Why a robot cannot grasp and place cubes from above at some places, in one sentence, or None.

    Args:
        robot: with its base.
        fixed: what stands in the way.
        places: of the cubes' centres.
        scale: of the scene over the study's.
    """
    model = RobotModel(robot)
    size = CUBE_SIZE * scale
    if not model.has_parallel_fingers and not model.has_one_jaw:
        return (
            f"robot {robot.name!r} has no hand with two parallel fingers to grasp a cube, nor one "
            "with a jaw that turns"
        )
    needed = size / 2 + CLEARANCE * scale
    if model.has_parallel_fingers and robot.gripper.opened < needed:
        return (
            f"robot {robot.name!r} opens its fingers to {robot.gripper.opened:g} m from the middle "
            f"and needs {needed:g} m for a cube of {size:g} m"
        )
    if model.has_one_jaw and robot.tool_frame != GRASP_LINK:  # `grasping` left it as it is
        return (
            f"robot {robot.name!r} opens its jaw to {robot.gripper.opened:g} rad, too little for a "
            f"cube of {size:g} m"
        )
    approach, beside = APPROACH * scale, grasp_of(robot, size, scale).beside
    planning = PlanningScene(model, Scene("reach", tuple(fixed), robot), scale)
    home, rng = robot.column("initial_position")[: model.arm], np.random.default_rng(0)
    for place in places:
        reason = ""
        for turned in top_down_grasps(place):
            tool = tool_over(place, turned.yaw)
            if beside:
                tool = tool * Pose.at(0.0, -beside, 0.0)
            try:
                above = inverse_kinematics(model, tool.translated(z=approach), home, rng)
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
