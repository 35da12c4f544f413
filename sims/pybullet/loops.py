"""Loops of links, closed by Bullet's constraint between points of two links."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pytest_simbench.scene import Closure, FloatArray, Pose, Vector3
from pytest_simbench.simulator import lazy_import

pybullet = lazy_import("pybullet")

STRONGEST = 1e5
"""Largest force of a closure [N]. Bullet's own, 500 N, lets go of heavier links."""


def close_loop(client: int, robot: int, links: Mapping[str, int], closure: Closure) -> int:
    """Hold the points together; Bullet's number of the constraint."""
    first, second = links[closure.first], links[closure.second]
    made: int = pybullet.createConstraint(
        robot,
        first,
        robot,
        second,
        pybullet.JOINT_POINT2POINT,
        [0, 0, 0],
        _from_centre(client, robot, first, closure.first_point),
        _from_centre(client, robot, second, closure.second_point),
        physicsClientId=client,
    )
    pybullet.changeConstraint(made, maxForce=STRONGEST, physicsClientId=client)
    return made


def points(client: int, constraint: int) -> FloatArray:
    """Of a closure, in the frames of its links, (2, 3) [m]."""
    info = pybullet.getConstraintInfo(constraint, physicsClientId=client)
    body, ends = info[0], ((info[1], info[6]), (info[3], info[7]))
    return np.array(
        [
            _inertial(client, body, link).rotation() @ at + _inertial(client, body, link).position
            for link, at in ends
        ]
    )


def _from_centre(client: int, robot: int, link: int, point: Vector3) -> Any:
    """A point of a link in the frame that Bullet counts from, at its centre of mass."""
    return (_inertial(client, robot, link).inverse() * Pose(point)).position


def _inertial(client: int, robot: int, link: int) -> Pose:
    """The inertial frame of a link in the link's frame."""
    dynamics = pybullet.getDynamicsInfo(robot, link, physicsClientId=client)
    x, y, z, w = dynamics[4]
    return Pose.from_array([*dynamics[3], w, x, y, z])
