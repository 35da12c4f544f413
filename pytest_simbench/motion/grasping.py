"""How a hand grasps cubes of some size: two parallel fingers as they are, one jaw in its own way.

The tool frame of a hand with one jaw lies on the face of its fixed jaw, and its y axis points to
the jaw that turns. To grasp a cube the tool centre point moves to where the cube's centre then is,
half an edge from the fixed jaw. The hand comes down beside the cube, its jaw open by little more
than the cube is wide, moves aside until the fixed jaw touches, and closes.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from pytest_simbench.description.robot_files import content_of, robot_cache
from pytest_simbench.motion.adapting import with_tool
from pytest_simbench.motion.collision import PlanningScene
from pytest_simbench.motion.errors import PlanningError, Unreachable
from pytest_simbench.motion.kinematics import inverse_kinematics, straight_line
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.scene import FloatArray, Pose, Robot, Scene, Vector3

CLEARANCE = 0.005
"""Least space between an open finger and a cube of the study's size [m]; it goes with the scale."""

GRASP_LINK, GRASP_JOINT = "grasp_centre_point", "joint_of_the_grasp_centre_point"

BISECTIONS = 40
"""Of the jaw's range; it then stands to 1e-12 rad where it should."""


@dataclass(frozen=True)
class Grasp:
    """How a hand grasps a cube.

    Attributes:
        touching: position of each finger that touches the cube [m, or rad].
        beside: how far aside the hand comes down, along minus y of its tool frame [m]; 0 for
            parallel fingers.
    """

    touching: float
    beside: float = 0.0


def grasp_of(robot: Robot, width: float, scale: float) -> Grasp:
    """How a robot of `grasping`, or one with parallel fingers, grasps a cube of that width [m]."""
    if robot.tool_frame != GRASP_LINK:
        return Grasp(width / 2)
    touching = _opening(robot, width / 2, width / 2)  # the tool centre point is in its middle
    assert touching is not None  # it opens wider
    return Grasp(touching, CLEARANCE * scale)


def grasping(robot: Robot, width: float, scale: float, wide: bool = False) -> Robot:
    """The robot as it grasps cubes: the tool centre point in the middle of the cube. A hand that is
    not one jaw stays as it is, and so does a jaw that does not open so wide.

    Args:
        width: of the cubes [m].
        scale: of the scene over the study's.
        wide: the jaw opens as far as it can: nothing stands beside the cube.
    """
    model = RobotModel(robot)
    if not model.has_one_jaw:
        return robot
    opened = _opening(robot, width + 2 * CLEARANCE * scale, width / 2)
    if opened is None:
        return robot
    if wide:
        opened = robot.gripper.opened
    joints = (*robot.joints[:-1], replace(robot.joints[-1], initial_position=opened))
    gripper = replace(robot.gripper, opened=opened)
    path = _adapted(robot, width)
    return replace(
        robot, urdf=path, packages={}, tool_frame=GRASP_LINK, joints=joints, gripper=gripper
    )


@robot_cache
def _adapted(robot: Robot, width: float) -> str:
    """The path of the description with the new tool centre point."""
    return with_tool(robot, Pose.at(0.0, width / 2, 0.0), GRASP_LINK, GRASP_JOINT).urdf


def width_of_jaw(robot: Robot) -> float:
    """Of the cubes that a robot of `grasping` was made for [m]."""
    origin = ET.fromstring(content_of(robot)["urdf"]).find(f"joint[@name='{GRASP_JOINT}']/origin")
    assert origin is not None  # `with_tool` wrote it
    return 2 * float(origin.attrib["xyz"].split()[1])


@robot_cache
def _opening(robot: Robot, gap: float, above: float) -> float | None:
    """Position of the jaw at which it stands so far from y = 0 of the tool frame [rad]; None where
    it cannot."""
    planning = PlanningScene(RobotModel(robot), Scene("gap", (), robot))
    low, high = robot.gripper.closed, robot.gripper.opened
    if planning.gap(high, above) < gap:
        return None
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        low, high = (middle, high) if planning.gap(middle, above) < gap else (low, middle)
    return high


RESTARTS, FURTHER_RESTARTS = 10, 40
"""Of the search for joint positions: for those nearest to home, and for others where these will not
do. An arm of six joints has up to eight for a pose, the UR5 many more by whole turns."""


class Choice(NamedTuple):
    """A pose of the tool, and the arm joints above it, (arm,) [rad]."""

    tool: Pose
    above: FloatArray


def choose(
    scene: PlanningScene,
    tools: Sequence[Pose],
    approach: float,
    home: FloatArray,
    arm: FloatArray,
    rng: np.random.Generator,
    ignored: Sequence[str] = (),
    way: Vector3 | None = None,
) -> Choice:
    """The pose that is free and needs the least joint travel.

    The arm takes the joint positions nearest to home. Where those touch something for all poses, or
    lead nowhere from above, it looks for others.

    Args:
        tools: equivalent poses of the tool in the world.
        approach: how far above the pose must be free, too, with the planning scene's margin [m].
        home: arm joints where the search starts, (arm,) [rad].
        arm: present arm joints, (arm,) [rad].
        ignored: bodies that may be touched.
        way: on which the tool must be able to go on from above, straight [m].

    Raises:
        PlanningError: none is free, and why the last one is not.
    """
    reason: PlanningError = Unreachable("unreachable")
    for restarts in (RESTARTS, FURTHER_RESTARTS):
        found = []
        for tool in tools:
            try:
                found.append(_free(scene, tool, approach, home, rng, ignored, way, restarts))
            except PlanningError as error:
                reason = error
        if found:
            return min(found, key=lambda choice: float(np.abs(choice.above - arm).max()))
    raise reason


def _free(
    scene: PlanningScene,
    tool: Pose,
    approach: float,
    home: FloatArray,
    rng: np.random.Generator,
    ignored: Sequence[str],
    way: Vector3 | None,
    restarts: int,
) -> Choice:
    """One of them; raises `PlanningError` where it is out of reach, or touches something."""

    over = tool.translated(z=approach)

    def check(above: FloatArray) -> None:
        at = inverse_kinematics(scene.model, tool, above)
        for arm, margin in ((at, False), (above, True)):
            touching = scene.collision(arm, ignored=ignored, margin=margin)
            if touching is not None:
                raise PlanningError(f"in collision: {' and '.join(touching)}")
        if way is not None:
            straight_line(scene.model, above, over.translated(*way))

    def wanted(above: FloatArray) -> bool:
        try:
            if restarts != RESTARTS:
                check(above)
        except PlanningError:
            return False
        return True

    above = inverse_kinematics(scene.model, over, home, rng, restarts, wanted)
    check(above)
    return Choice(tool, above)
