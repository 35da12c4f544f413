"""The small worlds in which the checks look at one thing each, and where to fly a cube so that it
touches one link of the robot first."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from pytest_simbench.description.links import link_poses
from pytest_simbench.description.shapes import DIRECTIONS, placed, shape_points
from pytest_simbench.laws.hands import GAP, HELD, around
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.panda import panda
from pytest_simbench.scene import STANDARD_GRAVITY, Box, FloatArray, Pose, Robot, Scene, Vector3
from pytest_simbench.scene.pose import turn_of_z
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
        robot = robot.with_joints(joint.name, initial_position=float(low + share * (high - low)))
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


_EDGE = 0.02
"""Of the flying cube [m]: small enough to reach between the links."""

_POSTURES = 50
"""That are tried."""

_GAP = 0.005
"""From the cube's face to the link [m]."""


@dataclass(frozen=True)
class Approach:
    """A cube, its face parallel to a link's farthest point in some direction, near to it.

    Attributes:
        direction: of flight, unit vector.
        start: of the cube's centre [m].
        distance: that the cube can fly [m].
    """

    link: str
    direction: FloatArray
    start: FloatArray
    distance: float = _GAP

    def cube(self) -> Box:
        pose = Pose.from_array([*self.start, *turn_of_z(self.direction)])
        return Box(f"to_{self.link}", (_EDGE,) * 3, pose, MASS)


def link_clouds(robot: Robot) -> dict[str, FloatArray]:
    """The corners of each link that has a shape, in the world, (n, 3) [m]: its hull's."""
    prepared = PreparedRobot(robot)
    poses = link_poses(prepared)
    return {
        link.name: np.vstack([placed(shape_points(s), poses[link.name]) for s in link.shapes])
        for link in prepared.links.values()
        if link.shapes
    }


def approaches(robot: Robot) -> Iterator[tuple[Robot, list[Approach]]]:
    """One approach to every link that moves, in groups that fly in one direction, each with the
    robot as it stands then: as it is, and high up in random postures where others hide a link.

    Raises:
        LookupError: no cube reaches some of the links.
    """
    rng, waiting = np.random.default_rng(0), list(link_clouds(robot))
    waiting.remove(PreparedRobot(robot).root)
    for _ in range(_POSTURES):
        clouds = link_clouds(robot)
        while group := max((_reachable(waiting, clouds, d) for d in DIRECTIONS), key=len):
            yield robot, group
            waiting = [name for name in waiting if name not in {a.link for a in group}]
        if not waiting:
            return
        robot = at_random(lifted(robot), rng)
    raise LookupError(f"no cube can be flown to {', '.join(waiting)} of {robot.name}")


def beside(robot: Robot, x: float, y: float) -> tuple[float, float]:
    """The first place [m] from (x, y) on, away from the z axis, that no link is over or near."""
    clouds = [cloud[:, :2] for cloud in link_clouds(robot).values()]
    place, away = np.array([x, y]), np.array([x, y]) / 20
    while any(_near(cloud, place) for cloud in clouds):
        place += away
    return float(place[0]), float(place[1])


def _near(cloud: FloatArray, place: FloatArray) -> bool:
    """Whether a place lies in the rectangle about the points, or within two edges of it."""
    low, high = cloud.min(axis=0) - 2 * _EDGE, cloud.max(axis=0) + 2 * _EDGE
    return bool(((place > low) & (place < high)).all())


def _reachable(
    links: list[str], clouds: dict[str, FloatArray], direction: FloatArray
) -> list[Approach]:
    """Approaches along `direction`, to as many of the links as there is room for."""
    chosen: list[Approach] = []
    for link in links:
        tip = clouds[link][np.argmin(clouds[link] @ direction)]
        start = tip - direction * (_GAP + _EDGE / 2)
        approach = Approach(link, direction, start)
        others = (cloud for name, cloud in clouds.items() if name != link)
        room = start[2] > 2 * _EDGE and all(_clear(cloud, start, direction) for cloud in others)
        apart = all(np.linalg.norm(start - other.start) > 3 * _EDGE for other in chosen)
        if room and apart:
            chosen.append(approach)
    return chosen


def _clear(cloud: FloatArray, start: FloatArray, direction: FloatArray) -> bool:
    """Whether all of a link's hull lies beyond the cube's flight, or well aside."""
    ahead = (cloud - start) @ direction
    if ahead.min() > _EDGE / 2 + 2 * _GAP:
        return True
    away = (cloud - start) - np.outer(ahead, direction)
    low, high = away.min(axis=0), away.max(axis=0)
    return bool((low > 2 * _EDGE).any() or (high < -2 * _EDGE).any())
