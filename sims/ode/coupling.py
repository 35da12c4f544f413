"""What couples the fingers: a pinion between two racks.

pyode wraps no gears. But the friction row of a contact, without a limit, is what holds two teeth
together: it keeps the velocities of two bodies equal at a point, along one direction. So a small
body, hinged to the hand, touches each finger at a point of its rim, the two opposite to each other.
It carries the fingers' rotors. The points are thought: nothing is there to collide.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pytest_simbench.scene import FloatArray
from pytest_simbench.simulator import NotSupportedError, lazy_import

from .axes import Axis

ode = lazy_import("ode")

RADIUS = 0.01
"""Of the pinion [m]. It turns with the rotors' inertia times RADIUS^2: 2e-5 kg m^2."""

MASS = 1e-3
"""Of the pinion [kg], without weight."""

LIGHTEST = 1e-6
"""The rotors' least inertia [kg], where the scene has none: the pinion needs some."""

CORRECTED = 0.2
"""Share of the difference between the fingers that is corrected in a step."""

SLACK = 1.0
"""Softness of the contacts across the teeth [m/(N s)]: the racks do not press. With 1e10 ODE ended
the process (an assertion of its LCP solver: a pivot of 0)."""


class Pinion:
    """Two sliding fingers that move alike.

    Args:
        world: of ODE.
        first, second: joints of the fingers, which slide in the same hand.
        inertia: of the fingers' rotors, together [kg].
        timestep: [s].

    Attributes:
        fingers: both joints.
        body: of ODE.

    Raises:
        NotSupportedError: fingers that turn, or are not of one hand.
    """

    def __init__(
        self, world: Any, first: Axis, second: Axis, inertia: float, timestep: float
    ) -> None:
        if first.hinged or second.hinged or first.parent is None:
            raise NotSupportedError("ode couples two fingers that slide in one hand, no others")
        self._world, self.fingers, self._hand = world, (first, second), first.parent
        self._correction = CORRECTED / timestep / 2
        centre = np.mean([first.child.getPosition(), second.child.getPosition()], axis=0)
        directions = [np.array(axis.joint.getAxis()) for axis in self.fingers]
        shaft = _across(directions[0])
        self._arms = [
            self._hand.vectorFromWorld(tuple(np.cross(direction, shaft)))
            for direction in directions
        ]
        self.body = ode.Body(world)
        weight, moment = ode.Mass(), max(inertia, LIGHTEST) * RADIUS**2
        weight.setParameters(MASS, 0, 0, 0, moment, moment, moment, 0, 0, 0)
        self.body.setMass(weight)
        self.body.setGravityMode(False)
        self.body.setPosition(tuple(centre))
        self._hinge = ode.HingeJoint(world)
        self._hinge.attach(self.body, self._hand)
        self._hinge.setAnchor(tuple(centre))
        self._hinge.setAxis(tuple(shaft))
        self._contact = _teeth()
        self._group = ode.JointGroup()
        self._racks: list[Any] = []

    @property
    def inertia(self) -> float:
        """Of the rotors, together [kg]."""
        return float(self.body.getMass().I[0][0]) / RADIUS**2

    @property
    def holds(self) -> bool:
        """Whether each finger is held to the pinion."""
        return [rack.getBody(0) for rack in self._racks] == [axis.child for axis in self.fingers]

    def mesh(self) -> None:
        """Before a step: hold the fingers to the pinion where it is now."""
        self.release()
        first, second = self.fingers
        apart = self._correction * (first.position() - second.position())
        x, y, z = self.body.getPosition()
        for axis, arm, speed in zip(self.fingers, self._arms, (-apart, apart), strict=True):
            u, v, w = normal = self._hand.vectorToWorld(arm)
            at = (x + RADIUS * u, y + RADIUS * v, z + RADIUS * w)
            self._contact.setContactGeomParams(at, normal, 0.0)
            self._contact.setFDir1(axis.joint.getAxis())
            self._contact.setMotion1(speed)
            rack = ode.ContactJoint(self._world, self._group, self._contact)
            rack.attach(axis.child, self.body)
            self._racks.append(rack)

    def release(self) -> None:
        """Let the fingers go."""
        self._group.empty()
        self._racks.clear()


def _across(direction: FloatArray) -> FloatArray:
    """A unit vector at right angles to another."""
    other = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
    return np.asarray(other / np.linalg.norm(other))


def _teeth() -> Any:
    """Contact parameters of a row without limit along one direction, and nothing across it."""
    contact = ode.Contact()
    contact.setMode(ode.ContactFDir1 | ode.ContactMu2 | ode.ContactMotion1 | ode.ContactSoftCFM)
    contact.setMu(ode.Infinity)
    contact.setMu2(0.0)
    contact.setSoftCFM(SLACK)
    return contact
