"""The small worlds in which the checks look at one thing each."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pytest_simbench.laws.hands import GAP, HELD, around
from pytest_simbench.laws.hands import of_scene as of_scene
from pytest_simbench.laws.hands import squeezing as squeezing
from pytest_simbench.laws.hands import with_joint as with_joint
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.panda import panda
from pytest_simbench.scene import (
    STANDARD_GRAVITY,
    Box,
    Pose,
    Robot,
    Scene,
    Vector3,
)
from pytest_simbench.simulator import PreparedRobot

GRAVITY = -STANDARD_GRAVITY[2]
EDGE, MASS = HELD, 0.1
"""The cube of the tasks [m], [kg]."""

Vertices = tuple[Vector3, ...]


def cube(name: str, pose: Pose, mass: float = MASS, friction: float = 1.0) -> Box:
    return Box(name, (EDGE, EDGE, EDGE), pose, mass, friction)


def falling() -> Scene:
    """One cube, yawed by 0.3 rad, 6 m above the ground, and a fixed box aside."""
    return Scene(
        "falling",
        (
            Box("post", (0.1, 0.1, 0.4), Pose.at(1, 1, 0.2)),
            cube("falling", Pose.at(0.1, 0.2, 6.0, yaw=0.3)),
            Box("shelf", (0.1, 0.1, 0.1), Pose.at(-1, 1, 0.05)),
            cube("resting", Pose.at(-0.5, -0.3, EDGE / 2)),
        ),
    )


def wedge(length: float = 0.1, width: float = 0.05, height: float = 0.04) -> Vertices:
    """Corners of a wedge about its centre [m]: on its lower face, whose height above the ground is
    a third of its own, it stands as a box does."""
    ends = [(-length / 2, -height / 3), (length / 2, -height / 3), (0.0, 2 * height / 3)]
    return tuple((x, y, z) for x, z in ends for y in (-width / 2, width / 2))


def tower() -> Scene:
    """Three cubes upon each other."""
    return Scene(
        "tower", tuple(cube(f"level{i}", Pose.at(0.4, 0, EDGE * (i + 0.5))) for i in range(3))
    )


def incline(slope: float, mu: float) -> Scene:
    """A slab on the plane, gravity tilted by atan(slope) along x."""
    angle = math.atan(slope)
    gravity = (GRAVITY * math.sin(angle), 0.0, -GRAVITY * math.cos(angle))
    slab = Box("slab", (0.1, 0.1, 0.02), Pose.at(0, 0, 0.01), MASS, mu)
    return Scene(f"incline {slope} {mu}", (slab,), gravity=gravity, ground_friction=mu)


def tumbling(size: Vector3) -> Scene:
    """A box that falls upon the edge of a fixed one high above the ground, and spins on freely."""
    turn = Pose(quaternion=(math.cos(0.2), math.sin(0.2) * 0.6, math.sin(0.2) * 0.8, 0.0))
    start = Pose((0.0, 0.0, 5.25), (turn * Pose.at(0, 0, 0, yaw=0.4)).quaternion)
    ledge = Box("ledge", (0.2, 0.4, 0.1), Pose.at(-0.115, 0.0, 5.05))
    return Scene(f"tumbling {size}", (ledge, Box("box", size, start, MASS)))


def arm() -> Robot:
    """The Panda."""
    return panda()


def lifted(robot: Robot) -> Robot:
    """The same robot, so high above the ground that it does not touch it in any posture."""
    return replace(robot, base=Pose.at(0.0, 0.0, max(2.0, 1.2 * RobotModel(robot).reach)))


def at_random(robot: Robot, rng: np.random.Generator) -> Robot:
    """The same robot starting at random joint positions, its fingers alike."""
    limits = PreparedRobot(robot).limits
    opening = rng.uniform(0.2, 0.8)
    for joint in robot.joints:
        low, high = limits[joint.name]
        share = opening if joint.name in robot.gripper.joints else rng.uniform(0.1, 0.9)
        robot = with_joint(robot, joint.name, initial_position=float(low + share * (high - low)))
    return robot


def arm_alone(
    robot: Robot | None = None, gravity: Vector3 = STANDARD_GRAVITY, name: str = "arm"
) -> Scene:
    return Scene(name, robot=robot or arm(), gravity=gravity)


def grip(
    robot: Robot | None = None, mass: float = MASS, gap: float = GAP, name: str = "grip"
) -> Scene:
    """A robot with a cube between its fingers, which stand `gap` [m] from it on either side."""
    robot = around(robot or arm(), gap)
    start = robot.column("initial_position")
    held = cube("held", RobotModel(robot).tool_pose(np.asarray(start)), mass)
    return Scene(name, (held,), robot=robot)
