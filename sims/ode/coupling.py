"""What couples two joints: a pinion between racks.

pyode wraps no gears. But the friction row of a contact, without a limit, is what holds two teeth
together: it keeps the velocities of two bodies equal at a point, along one direction. So a small
body, hinged to the link that both joints have in common, touches what moves on it by either joint:
two fingers that face each other at opposite points of its rim. The points are thought: nothing is
there to collide.

Where a joint moves by k times the pinion's angle, a point and a direction u are right if the
pinion's velocity there, along u, is k times the joint's. Of a slider that is the point of the rim
at radius k, and u its axis; of a hinge see `_hinged`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pytest_simbench.scene import Coupling, FloatArray
from pytest_simbench.simulator import lazy_import

from .axes import Axis

ode = lazy_import("ode")

RADIUS = 0.01
"""Of the pinion for a leader that slides [m]. It turns with the rotors' inertia times RADIUS^2:
2e-5 kg m^2. With a leader that turns it turns alike."""

LEVER = 0.1
"""From the axis of a hinge to where the pinion holds it [m]."""

MASS = 1e-3
"""Of the pinion [kg], without weight."""

LIGHTEST = 1e-6
"""The rotors' least inertia [kg or kg m^2], where the scene has none: the pinion needs some."""

CORRECTED = 0.2
"""Share of the joints' error that is corrected in a step."""

PARALLEL = 1e-6
"""Sine of the angle below which two directions are one."""

SLACK = 1.0
"""Softness of the contacts across the teeth [m/(N s)]: the racks do not press. With 1e10 ODE ended
the process (an assertion of its LCP solver: a pivot of 0)."""


class Pinion:
    """Two joints that move together.

    Args:
        axes: the joints by name; both have a link in common, or the world.
        inertia: of the rotors of both, as the leader has it [kg or kg m^2].
        timestep: [s].

    Attributes:
        joints: leader and follower.
    """

    def __init__(
        self, world: Any, pair: Coupling, axes: Mapping[str, Axis], inertia: float, timestep: float
    ) -> None:
        self._world, self._pair = world, pair
        self.joints = leader, follower = axes[pair.leader], axes[pair.follower]
        ends = [follower.parent, follower.child]
        shared = any(leader.parent is end for end in ends)
        self._link = link = leader.parent if shared else leader.child
        signs = [1.0 if axis.parent is link else -1.0 for axis in self.joints]
        directions = [
            sign * np.array(axis.joint.getAxis())
            for axis, sign in zip(self.joints, signs, strict=True)
        ]
        centre = np.mean([axis.child.getPosition() for axis in self.joints], axis=0)
        shaft = _across(*directions)
        self._leads = 1.0 if leader.hinged else RADIUS
        self.body = ode.Body(world)
        weight, moment = ode.Mass(), max(inertia, LIGHTEST) * self._leads**2
        weight.setParameters(MASS, 0, 0, 0, moment, moment, moment, 0, 0, 0)
        self.body.setMass(weight)
        self.body.setGravityMode(False)
        self.body.setPosition(tuple(centre))
        self._hinge = ode.HingeJoint(world)
        self._hinge.attach(self.body, link)
        self._hinge.setAnchor(tuple(centre))
        self._hinge.setAxis(tuple(shaft))
        share = CORRECTED / timestep / (1 + pair.ratio**2)
        self._teeth = []
        for axis, direction, ratio, corrected in zip(
            self.joints, directions, (1.0, pair.ratio), (pair.ratio * share, -share), strict=True
        ):
            k = ratio * self._leads
            found = _hinged(axis, direction, centre, shaft, k) if axis.hinged else None
            point, normal, along, speed = found or _sliding(direction, centre, shaft, k)
            wheel = axis.child if axis.parent is link else axis.parent
            bodies, sign = ((wheel, self.body), 1.0) if wheel else ((self.body, None), -1.0)
            place = link.getPosRelPoint(tuple(point)) if link else tuple(point)
            turn = link.vectorFromWorld if link else tuple
            tooth = (bodies, place, turn(tuple(normal)), turn(tuple(along)))
            self._teeth.append((*tooth, sign * speed * corrected))
        self._contact = _tooth()
        self._group = ode.JointGroup()
        self._racks: list[Any] = []

    @property
    def inertia(self) -> float:
        """Of the rotors, together, as the leader has it [kg or kg m^2]."""
        return float(self.body.getMass().I[0][0]) / self._leads**2

    @property
    def holds(self) -> bool:
        """Whether both joints are held to the pinion."""
        held = [(rack.getBody(0), rack.getBody(1)) for rack in self._racks]
        return held == [bodies for bodies, *_ in self._teeth]

    def mesh(self) -> None:
        """Before a step: hold the joints to the pinion where it is now."""
        self.release()
        leader, follower = self.joints
        pair, link, contact = self._pair, self._link, self._contact
        error = follower.position() - pair.ratio * leader.position() - pair.offset
        for bodies, place, normal, along, corrected in self._teeth:
            if link is not None:
                place, normal = link.getRelPointPos(place), link.vectorToWorld(normal)
                along = link.vectorToWorld(along)
            contact.setContactGeomParams(place, normal, 0.0)
            contact.setFDir1(along)
            contact.setMotion1(corrected * error)
            rack = ode.ContactJoint(self._world, self._group, contact)
            rack.attach(*bodies)
            self._racks.append(rack)

    def release(self) -> None:
        """Let the joints go."""
        self._group.empty()
        self._racks.clear()


Tooth = tuple[FloatArray, FloatArray, FloatArray, float]
"""Point, normal and direction in the world, and the joint's velocity there, along the direction, at
unit joint speed. Nothing moves along the normal against each other."""


def _sliding(direction: FloatArray, centre: FloatArray, shaft: FloatArray, k: float) -> Tooth:
    """Of a slider along `direction`."""
    normal = np.cross(direction, shaft)
    return centre + k * normal, normal, direction, 1.0


def _hinged(
    axis: Axis, direction: FloatArray, centre: FloatArray, shaft: FloatArray, k: float
) -> Tooth:
    """Of a hinge about `direction`: beside its axis it moves along the shaft, across which the
    pinion moves. The direction lies between both."""
    beside, anchor = np.cross(direction, shaft), np.array(axis.joint.getAnchor())
    rims = {y: np.cross(shaft, anchor + y * beside - centre) for y in (LEVER, -LEVER)}
    y, rim = max(rims.items(), key=lambda item: float(np.linalg.norm(item[1])))
    along = k * y / (rim @ rim) * rim - shaft
    length = float(np.linalg.norm(along))
    normal = np.cross(along, rim + k * y * shaft)
    return (
        anchor + y * beside,
        normal / np.linalg.norm(normal),
        along / length,
        y / length,
    )


def _across(first: FloatArray, second: FloatArray) -> FloatArray:
    """A unit vector at right angles to both."""
    if np.linalg.norm(np.cross(first, second)) < PARALLEL:
        second = np.eye(3)[np.argmin(np.abs(first))]
    found = np.cross(first, second)
    return np.asarray(found / np.linalg.norm(found))


def _tooth() -> Any:
    """Contact parameters of a row without limit along one direction, and nothing across it."""
    contact = ode.Contact()
    contact.setMode(ode.ContactFDir1 | ode.ContactMu2 | ode.ContactMotion1 | ode.ContactSoftCFM)
    contact.setMu(ode.Infinity)
    contact.setMu2(0.0)
    contact.setSoftCFM(SLACK)
    return contact
