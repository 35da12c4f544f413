"""What couples the fingers: a pinion between racks.

pyode wraps no gears. But the friction row of a contact, without a limit, is what holds two teeth
together: it keeps the velocities of two bodies equal at a point, along one direction. So a small
body, hinged to the hand, touches each finger at a point of its rim: two fingers that face each
other at opposite points. It carries the fingers' rotors. The points are thought: nothing is there
to collide.
"""

from __future__ import annotations

from collections.abc import Sequence
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

PARALLEL = 1e-6
"""Sine of the angle below which two directions are one."""

SLACK = 1.0
"""Softness of the contacts across the teeth [m/(N s)]: the racks do not press. With 1e10 ODE ended
the process (an assertion of its LCP solver: a pivot of 0)."""


class Pinion:
    """Sliding fingers that move alike.

    Args:
        world: of ODE.
        fingers: their joints; they slide in the same hand, in one plane.
        inertia: of the fingers' rotors, together [kg].
        timestep: [s].

    Attributes:
        fingers: their joints.
        body: of ODE.

    Raises:
        NotSupportedError: fingers that turn, are not of one hand, or slide in no plane.
    """

    def __init__(
        self, world: Any, fingers: Sequence[Axis], inertia: float, timestep: float
    ) -> None:
        hand = fingers[0].parent
        if hand is None or any(axis.hinged or axis.parent is not hand for axis in fingers):
            raise NotSupportedError("ode couples fingers that slide in one hand, no others")
        self._world, self.fingers, self._hand = world, tuple(fingers), hand
        self._correction = CORRECTED / timestep / len(fingers)
        centre = np.mean([axis.child.getPosition() for axis in fingers], axis=0)
        directions = [np.array(axis.joint.getAxis()) for axis in fingers]
        shaft = _across(directions)
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
        positions = [axis.position() for axis in self.fingers]
        x, y, z = self.body.getPosition()
        for axis, arm, position in zip(self.fingers, self._arms, positions, strict=True):
            apart = sum(position - other for other in positions)
            u, v, w = normal = self._hand.vectorToWorld(arm)
            at = (x + RADIUS * u, y + RADIUS * v, z + RADIUS * w)
            self._contact.setContactGeomParams(at, normal, 0.0)
            self._contact.setFDir1(axis.joint.getAxis())
            self._contact.setMotion1(-self._correction * apart)
            rack = ode.ContactJoint(self._world, self._group, self._contact)
            rack.attach(axis.child, self.body)
            self._racks.append(rack)

    def release(self) -> None:
        """Let the fingers go."""
        self._group.empty()
        self._racks.clear()


def _across(directions: Sequence[FloatArray]) -> FloatArray:
    """A unit vector at right angles to all."""
    first = directions[0]
    others = [other for other in directions if np.linalg.norm(np.cross(first, other)) > PARALLEL]
    second = others[0] if others else np.eye(3)[np.argmin(np.abs(first))]
    found = np.cross(first, second)
    found /= np.linalg.norm(found)
    if any(abs(found @ direction) > PARALLEL for direction in directions):
        raise NotSupportedError("ode couples fingers that slide in one plane, no others")
    return np.asarray(found)


def _teeth() -> Any:
    """Contact parameters of a row without limit along one direction, and nothing across it."""
    contact = ode.Contact()
    contact.setMode(ode.ContactFDir1 | ode.ContactMu2 | ode.ContactMotion1 | ode.ContactSoftCFM)
    contact.setMu(ode.Infinity)
    contact.setMu2(0.0)
    contact.setSoftCFM(SLACK)
    return contact
