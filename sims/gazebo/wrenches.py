"""Forces and torques on free bodies, each for one step: those of the scene, and those that give
what Gazebo's engines do not have, a velocity at the start and damping."""

from __future__ import annotations

from typing import Any

import numpy as np

from pytest_simbench.scene import Body, FloatArray, rotation_matrix

from .bindings import bindings


class Wrenches:
    """Forces and torques on the free bodies.

    Args:
        timestep: [s].
        turned: whether the engine takes a torque in the body's axes, not in the world's.

    Attributes:
        thrown: velocities at the start, (n_free, 6).
    """

    def __init__(
        self, ecm: Any, bodies: tuple[Body, ...], links: list[Any], timestep: float, turned: bool
    ) -> None:
        self._ecm, self._timestep, self._turned, self._links = ecm, timestep, turned, links
        self.thrown = np.array([body.velocity for body in bodies]).reshape(-1, 6)
        self._damped = [
            (row, body, links[row], np.expm1(-timestep * np.repeat(body.damping, 3)))
            for row, body in enumerate(bodies)
            if np.any(body.damping)
        ]
        for body, link in zip(bodies, links, strict=True):
            if body.mass and body.velocity.any():  # not a prescribed one
                self._change(link, body, body.pose.rotation(), body.velocity)

    def act(self, states: FloatArray) -> None:
        """Before a step: damp the bodies that the scene damps. A step of duration h leaves
        exp(-c h) of a velocity.

        Args:
            states: of the free bodies, (n_free, 13).
        """
        for row, body, link, lost in self._damped:
            turn = rotation_matrix(states[row, 3:7])
            self._change(link, body, turn, lost * states[row, 7:])

    def push(self, wrenches: FloatArray, states: FloatArray) -> None:
        """The scene's forces and torques, (n_free, 6), for one step; states as of `act`."""
        for row, wrench in enumerate(wrenches):
            if wrench.any():
                self._add(self._links[row], rotation_matrix(states[row, 3:7]), wrench)

    @property
    def damps(self) -> bool:
        """Whether any body is damped."""
        return bool(self._damped)

    def _change(self, link: Any, body: Body, turn: FloatArray, by: FloatArray) -> None:
        """Give a body other velocities in the next step [m/s, rad/s], (6,).

        A force m v / h changes a velocity by v in a step of duration h. Gazebo's own velocity
        commands would hold on in all further steps.
        """
        inertia = turn @ np.diag(body.inertia()) @ turn.T
        wrench = np.concatenate([body.mass * by[:3], inertia @ by[3:]]) / self._timestep
        self._add(link, turn, wrench)

    def _add(self, link: Any, turn: FloatArray, wrench: FloatArray) -> None:
        """A force and a torque in the world's axes [N, N m], (6,), for one step."""
        vector3 = bindings().math.Vector3d
        torque = turn.T @ wrench[3:] if self._turned else wrench[3:]
        link.add_world_wrench(self._ecm, vector3(*wrench[:3]), vector3(*torque))
