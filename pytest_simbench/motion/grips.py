"""Where two fingers can grasp a body from above: by its shape, its pose and the hand's stroke.

Fingers close level and press along their line. So they hold what has two faces, edges or round
sides that stand opposite each other: boxes, tubes and balls at their middle, a mesh at each of its
faces that stands upright and has something opposite (a polygon's width is least where one side is
an edge and the corner opposite projects into it: Goldberg, Orienting polygonal parts without
sensors, Algorithmica 10, 1993).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pytest_simbench.description.robot_files import robot_cache
from pytest_simbench.motion.collision import PlanningScene
from pytest_simbench.motion.errors import PlanningError
from pytest_simbench.motion.grasping import CLEARANCE, GRASP_LINK, width_of_jaw
from pytest_simbench.motion.kinematics import level_turns, tool_over
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.scene import Body, ConvexMesh, FloatArray, Pose, Robot, Scene

SLACK = 0.002
"""Between a finger and a body, its top, or the ground [m]. It goes with the scene's scale."""

LEANING = 0.1
"""Most share of a mesh's normal that may point up or down where a finger presses: 6 degrees."""

FACE = 1e-6
"""Corners of a face stand out by the same, but for this [m]."""


class Ungraspable(PlanningError):
    """No hand of this kind holds the body as it lies."""


@dataclass(frozen=True)
class Grip:
    """A way to grasp a body: the pose of the tool centre point in the world, and how wide the body
    is between the fingers [m]."""

    tool: Pose
    width: float


@dataclass(frozen=True)
class Hand:
    """What a hand holds: widths from `closed` to `opened` [m], and how far its palm stands above
    the tool centre point and its tips below it [m]."""

    closed: float
    opened: float
    palm: float
    tips: float


@robot_cache
def hand_of(robot: Robot, scale: float) -> Hand:
    """Raises `Ungraspable` where there is no hand that grasps."""
    model, gripper = RobotModel(robot), robot.gripper
    palm, tips = PlanningScene(model, Scene("hand", (), robot)).depths()
    if model.has_parallel_fingers:
        return Hand(2 * gripper.closed, 2 * gripper.opened, palm, tips)
    if not model.has_one_jaw:
        raise Ungraspable(f"robot {robot.name!r} has no hand with two fingers, nor with one jaw")
    if robot.tool_frame != GRASP_LINK:
        raise Ungraspable(
            f"the jaw of robot {robot.name!r} is set for nothing; give the scene a robot of "
            "`motion.grasping.grasping`, made for the body's width"
        )
    width = width_of_jaw(robot)
    return Hand(width - SLACK * scale, width + 2 * CLEARANCE * scale, math.inf, tips)


def grips(robot: Robot, body: Body, scale: float = 1.0) -> list[Grip]:
    """All ways in which a robot's hand grasps a body from above, where it lies.

    Args:
        body: at its present pose.
        scale: of the scene's lengths over those of the study's.

    Raises:
        Ungraspable: there is none; one sentence says why.
    """
    hand = hand_of(robot, scale)
    found = [grip for grip in (_at(body, yaw, hand, scale) for yaw in _yaws(body)) if grip]
    if not found:
        raise Ungraspable(
            f"{_called(body)} has no two sides opposite each other that fingers from above reach; "
            "turn it, or move it with a closed hand"
        )
    fitting = [grip for grip in found if hand.closed < grip.width < hand.opened]
    if not fitting:
        least = min(grip.width for grip in found)
        verb = "fit" if least >= hand.opened else "fill"
        between = f"{100 * hand.closed:.3g} to {100 * hand.opened:.3g} cm"
        raise Ungraspable(
            f"{_called(body)} of {100 * least:.3g} cm does not {verb} the fingers of robot "
            f"{robot.name!r}, which hold {between}"
        )
    return fitting


def _at(body: Body, yaw: float, hand: Hand, scale: float) -> Grip | None:
    """The grip of a hand that is turned so about the vertical [rad]; None where the sides do not
    stand opposite each other, or end where the fingers do not reach."""
    line = np.array([-math.sin(yaw), math.cos(yaw), 0.0])
    turn, slack = body.pose.rotation(), SLACK * scale
    ahead, behind, top, bottom = body.reach(np.array([line, -line, UP, -UP]) @ turn).tolist()
    middle = (ahead - behind) / 2 * line
    low, high = -bottom, top
    if isinstance(body, ConvexMesh):
        corners = np.array(body.vertices) @ turn.T
        along = np.cross(UP, line)
        sides = [corners[corners @ way > reach - FACE] for way, reach in
                 ((line, ahead), (-line, behind))]  # fmt: skip
        (left, right), (low, high) = (_common(sides, axis) for axis in (along, UP))
        if left > right + FACE or low > high + FACE:
            return None
        middle = middle + (left + right) / 2 * along + (low + high) / 2 * UP
    height = max(middle[2], top - hand.palm + slack, min(hand.tips + slack - bottom, top - slack))
    if height > high:
        return None
    x, y, z = (float(part) for part in (middle[0], middle[1], height))
    return Grip(tool_over(body.pose.translated(x, y, z), yaw), ahead + behind)


UP = np.array([0.0, 0.0, 1.0])


def _common(sides: list[FloatArray], axis: FloatArray) -> tuple[float, float]:
    """From where to where both sides go along an axis."""
    ends = [(float((side @ axis).min()), float((side @ axis).max())) for side in sides]
    return max(low for low, _ in ends), min(high for _, high in ends)


def _yaws(body: Body) -> list[float]:
    """Turns of the hand at which it may be grasped [rad]."""
    if not isinstance(body, ConvexMesh):
        return level_turns(body.pose)
    normals = np.array(body.hull.normals) @ body.pose.rotation().T
    upright = normals[np.abs(normals[:, 2]) < LEANING]
    yaws = np.arctan2(-upright[:, 0], upright[:, 1])
    return sorted({round(float(yaw), 9) for yaw in (*yaws, *(yaws + math.pi))})


def _called(body: Body) -> str:
    return f"{body.name!r}, a {body.kind.replace('_', ' ')},"


def turns(body: Body) -> list[float]:
    """Eighths of a turn about its own z axis after which it looks the same [rad], from -pi on."""
    eighths = [k * math.pi / 4 for k in range(-4, 4)]
    ways = np.array([(x, y, z) for x in (-3, -1, 2) for y in (-2, 1, 3) for z in (-1, 0, 2)])
    seen = body.reach(ways.astype(float))
    same = [np.allclose(body.reach(ways @ Pose.at(0, 0, 0, yaw=k).rotation()), seen, atol=FACE)
            for k in eighths]  # fmt: skip
    return [turn for turn, alike in zip(eighths, same, strict=True) if alike]
