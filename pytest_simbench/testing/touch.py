"""Where to fly a cube so that it touches one link of the robot first: for the kit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pytest_simbench.scene import Box, FloatArray, Pose, Robot
from pytest_simbench.simulator import PreparedRobot
from pytest_simbench.simulator.kinematics import link_poses
from pytest_simbench.simulator.shapes import DIRECTIONS, placed, shape_points
from pytest_simbench.testing.scenes import MASS

_EDGE = 0.02
"""Of the flying cube [m]: small enough to reach between the links."""

_GAP = 0.005
"""From the cube's face to the link [m]."""


@dataclass(frozen=True)
class Approach:
    """A cube, its face parallel to a link's farthest point in some direction, near to it.

    Attributes:
        link: that is touched first.
        direction: of flight, unit vector.
        start: of the cube's centre [m].
        distance: that the cube can fly [m].
    """

    link: str
    direction: FloatArray
    start: FloatArray
    distance: float = _GAP

    def cube(self) -> Box:
        pose = Pose(_triple(self.start), _facing(self.direction))
        return Box(f"to_{self.link}", (_EDGE,) * 3, pose, MASS)


def approaches(robot: Robot) -> list[list[Approach]]:
    """One approach to every link that moves, in groups that fly in one direction."""
    prepared = PreparedRobot(robot)
    at = {joint.name: joint.initial_position for joint in robot.joints}
    poses = link_poses(prepared, at)
    clouds = {
        link.name: np.vstack([placed(shape_points(s), poses[link.name]) for s in link.shapes])
        for link in prepared.links.values()
        if link.shapes
    }
    groups: list[list[Approach]] = []
    waiting = [name for name in clouds if name != prepared.root]
    while waiting:
        group = max((_reachable(waiting, clouds, d) for d in DIRECTIONS), key=len)
        if not group:
            raise LookupError(f"no cube can be flown to {', '.join(waiting)} of {robot.name}")
        groups.append(group)
        waiting = [name for name in waiting if name not in {a.link for a in group}]
    return groups


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


def _triple(values: FloatArray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return (x, y, z)
