"""Friction anchors of the robot's links, made anew when the link turns.

Bullet leaves an anchored point of contact as it is for as long as it sticks, and its normal with
it, which is kept in the axes of the world (`btPersistentManifold::replaceContactPoint`). A hand
that turns with a cube in it takes the cube along, but the normals stay behind: the fingers end up
pushing the cube along their pads, or holding it between two opposite normals after they opened.
"""

from __future__ import annotations

import numpy as np

from pytest_simbench.scene import FloatArray
from pytest_simbench.simulator import lazy_import

pybullet = lazy_import("pybullet")

PERIOD = 1.0 / 60.0
"""Simulated time between two looks at the contacts [s]."""

TURN = 0.05
"""By how much a normal may be wrong before its anchor is made anew [rad]."""


class Anchors:
    """Looks after the anchors of one robot.

    Args:
        timestep: [s].
    """

    def __init__(self, client: int, robot: int, timestep: float) -> None:
        self._client = client
        self._robot = robot
        self._every = max(1, round(PERIOD / timestep))
        self._made: dict[int, FloatArray] = {}  # a link's rotation when its anchors were made

    def step(self, number: int) -> None:
        """Step the simulation, without anchors on links that have turned."""
        turned = self._turned() if number % self._every == 0 else []
        for link in turned:
            self._anchor(link, False)
        pybullet.stepSimulation(self._client)
        for link in turned:
            self._anchor(link, True)

    def save(self) -> dict[int, FloatArray]:
        """What `restore` takes."""
        return dict(self._made)

    def restore(self, state: dict[int, FloatArray]) -> None:
        self._made = dict(state)

    def _turned(self) -> list[int]:
        """The links whose normals have turned too far."""
        normals: dict[int, list[tuple[float, ...]]] = {}
        for point in pybullet.getContactPoints(self._robot, physicsClientId=self._client) or ():
            normals.setdefault(point[3], []).append(point[7])
        made, self._made, turned = self._made, {}, []
        for link, rows in normals.items():
            now = self._rotation(link)
            before = made.get(link, now)
            seen = np.array(rows)
            cosines = np.sum(seen * (seen @ (now @ before.T).T), axis=1)
            if cosines.min() < np.cos(TURN):
                turned.append(link)
                before = now
            self._made[link] = before
        return turned

    def _rotation(self, link: int) -> FloatArray:
        if link < 0:
            _, quaternion = pybullet.getBasePositionAndOrientation(self._robot, self._client)
        else:
            quaternion = pybullet.getLinkState(self._robot, link, physicsClientId=self._client)[5]
        return np.array(pybullet.getMatrixFromQuaternion(quaternion)).reshape(3, 3)

    def _anchor(self, link: int, on: bool) -> None:
        pybullet.changeDynamics(
            self._robot, link, frictionAnchor=int(on), physicsClientId=self._client
        )
