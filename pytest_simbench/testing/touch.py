"""Where to fly a cube so that it touches one link of the robot first: for the kit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pytest_simbench.description.links import link_poses
from pytest_simbench.description.shapes import DIRECTIONS, placed, shape_points
from pytest_simbench.scene import Box, FloatArray, Pose, Robot
from pytest_simbench.simulator import PreparedRobot
from pytest_simbench.testing.scenes import MASS, at_random, lifted

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
        pose = Pose.from_array([*self.start, *_facing(self.direction)])
        return Box(f"to_{self.link}", (_EDGE,) * 3, pose, MASS)


def link_clouds(robot: Robot) -> dict[str, FloatArray]:
    """The corners of each link that has a shape, in the world, (n, 3) [m]: its hull's."""
    prepared = PreparedRobot(robot)
    poses = link_poses(prepared, {joint.name: joint.initial_position for joint in robot.joints})
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


def _facing(direction: FloatArray) -> tuple[float, float, float, float]:
    """Quaternion of a shortest turn of the z axis to `direction`."""
    x, y, z = (float(value) for value in direction)
    if z < -1 + 1e-9:
        return (0.0, 1.0, 0.0, 0.0)
    length = float(np.sqrt(2 + 2 * z))
    return (length / 2, -y / length, x / length, 0.0)
