"""Which robots a law can be asked of: each function says why one cannot, in one sentence."""

from __future__ import annotations

from pytest_simbench.motion.model import RobotModel
from pytest_simbench.scene import Robot

CUBE, SPACE = 0.05, 0.01
"""Edge of the cube that a hand grasps, and space beside it on either side, open [m]."""


def finger_unit(robot: Robot) -> str:
    """Of the fingers' positions, "m" or "rad"."""
    return RobotModel(robot).finger_unit


def any_robot(robot: Robot) -> str | None:
    """Nothing is asked of the robot."""
    return None


def coupled(robot: Robot) -> str | None:
    """It must have two fingers that move together."""
    count = len(robot.gripper.joints)
    return None if count > 1 else f"{robot.name} has {count} finger joints: none is coupled"


def grasping(robot: Robot) -> str | None:
    """It must have two parallel fingers, which open wide enough for a cube."""
    if not RobotModel(robot).has_parallel_fingers:
        return f"{robot.name} has no hand with two parallel fingers"
    needed, opened = CUBE / 2 + SPACE, robot.gripper.opened
    if opened < needed:
        return f"{robot.name} opens its fingers to {opened:g} m; the law takes {needed:g} m"
    return None


def throwing(robot: Robot) -> str | None:
    """It must grasp, and know how to swing its arm for a throw."""
    return grasping(robot) or (
        None if robot.swing else f"robot {robot.name!r} has no swing for the throw"
    )
