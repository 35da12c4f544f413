"""The small worlds in which the checks look at one thing each."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from pytest_simbench.laws.hands import GAP, HELD, around
from pytest_simbench.laws.hands import of_scene as of_scene
from pytest_simbench.laws.hands import squeezing as squeezing
from pytest_simbench.laws.hands import with_joint as with_joint
from pytest_simbench.laws.sliding import block
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.panda import panda
from pytest_simbench.scene import (
    STANDARD_GRAVITY,
    Box,
    Capsule,
    ConvexMesh,
    Cylinder,
    Pose,
    Robot,
    Scene,
    Sphere,
    Vector3,
)
from pytest_simbench.simulator import PreparedRobot

GRAVITY = -STANDARD_GRAVITY[2]
EDGE, MASS = HELD, 0.1
"""The cube of the tasks [m], [kg]."""

Vertices = tuple[Vector3, ...]

RADIUS = 0.03
"""Of round bodies [m]."""


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


def thrown() -> Scene:
    """A turned cube that starts with velocities in all six directions."""
    turn = Pose((0.1, -0.2, 2.0), (0.5, 0.5, -0.1, 0.7))
    body = replace(
        cube("thrown", turn), linear_velocity=(1.0, -0.7, 1.5), angular_velocity=(3.0, -2.0, 1.5)
    )
    return Scene("thrown", (body,))


def ball(height: float, **values: Any) -> Sphere:
    """A ball whose centre is so high above the origin [m]."""
    return Sphere("ball", RADIUS, Pose.at(0.0, 0.0, height), MASS, **values)


def bouncing() -> Scene:
    """A ball that falls on the plane at 3 m/s, and leaves with 0.6 of it."""
    falling = ball(RADIUS + 0.05, linear_velocity=(0.0, 0.0, -3.0), restitution=0.6)
    return Scene("bouncing", (falling,), ground_restitution=0.6)


def damped() -> Scene:
    """A ball that flies and turns, braked in both, far from everything and without weight."""
    flying = ball(3.0, linear_velocity=(1.0, 0.0, 0.5), angular_velocity=(2.0, -1.0, 4.0))
    braked = replace(flying, linear_damping=0.8, angular_damping=0.5)
    return Scene("damped", (braked,), gravity=(0.0, 0.0, 0.0))


def driven() -> Scene:
    """A belt with a cube on it, and a plate that turns as it rises, both prescribed."""
    belt = Box("belt", (2.0, 0.4, 0.1), Pose.at(0.0, 0.0, 0.5), prescribed=True)
    plate = Box("plate", (0.4, 0.3, 0.1), Pose((0.0, 1.5, 0.8), (0.8, 0.0, 0.6, 0.0)))
    turning = {"linear_velocity": (0.0, 0.0, 0.2), "angular_velocity": (0.5, -0.3, 1.0)}
    return Scene(
        "driven",
        (
            replace(belt, linear_velocity=(0.5, 0.0, 0.0)),
            cube("cube", Pose.at(0.0, 0.0, 0.55 + EDGE / 2)),
            replace(plate, prescribed=True, **turning),  # type: ignore[arg-type]
        ),
    )


def standing() -> Scene:
    """One of each round body, at rest on the plane: the can on its end, the pill on its side."""
    lying = Pose((0.6, 0.0, RADIUS), (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0))
    return Scene(
        "standing",
        (
            ball(RADIUS),
            Cylinder("can", RADIUS, 2 * RADIUS, Pose.at(0.3, 0.0, RADIUS), MASS),
            Capsule("pill", RADIUS, 2 * RADIUS, lying, MASS),
        ),
    )


def wedge(length: float = 0.1, width: float = 0.05, height: float = 0.04) -> Vertices:
    """Corners of a wedge about its centre [m]: on its lower face, whose height above the ground is
    a third of its own, it stands as a box does."""
    ends = [(-length / 2, -height / 3), (length / 2, -height / 3), (0.0, 2 * height / 3)]
    return tuple((x, y, z) for x, z in ends for y in (-width / 2, width / 2))


def meshes() -> Scene:
    """Meshes: a slab that slides off at 1 m/s, a wedge at rest, and a box on a block on a block."""
    slab = ConvexMesh("slab", block((0.1, 0.1, 0.02)), Pose.at(0.0, 0.0, 0.01), MASS, 0.5)
    slab = replace(slab, linear_velocity=(1.0, 0.0, 0.0))
    lying = ConvexMesh("wedge", wedge(), Pose.at(0.0, 0.3, 0.04 / 3), MASS, 0.5)
    cubes = [
        ConvexMesh(name, block((EDGE,) * 3), Pose.at(0.4, 0.3, EDGE * (level + 0.5)), MASS, 0.5)
        for level, name in enumerate(("low", "high"))
    ]
    top = cube("top", Pose.at(0.4, 0.3, 2.5 * EDGE), friction=0.5)
    return Scene("meshes", (slab, lying, *cubes, top), ground_friction=0.5)


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


def collision() -> Scene:
    """A rolled cube falls upon the edge of one that stands on ice: nothing pushes sideways."""
    roll = (math.cos(0.3), 0.0, math.sin(0.3), 0.0)
    moving = cube("moving", Pose((-0.035, 0.0, 0.3), roll), friction=0.0)
    standing = cube("standing", Pose.at(0.0, 0.0, EDGE / 2), mass=2 * MASS, friction=0.0)
    return Scene("collision", (moving, standing), ground_friction=0.0)


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
