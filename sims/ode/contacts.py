"""Contacts: ODE names pairs that may touch, and the caller makes a joint of each contact point.

It calls back for each pair, here into Python. What this costs stands in docs/engines/ode.md.

A mesh gives a contact for each of its triangles, and so the same one many times where triangles
meet. ODE leaves those out itself, but only where the product of both normals is 1 to the last bit
(`GenerateContact` in collision_trimesh_box.cpp), which the rounding of a normal decides. Equal
contacts make equal rows, and ODE's solver gives up on those: all rows that it has not come to, of
drives and of contacts, are then without force for a step. So they are left out here.
"""

from __future__ import annotations

import math
import weakref
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pytest_simbench.scene import FloatArray, Pose
from pytest_simbench.simulator import lazy_import

from .library import Mesh, library

ode = lazy_import("ode")

GROUND, FIXED, FREE, BASE, LINK = 1, 2, 4, 8, 16
"""Categories of geoms."""

TOUCHES = {
    GROUND: FREE | LINK,
    FIXED: FREE | LINK,
    FREE: GROUND | FIXED | FREE | BASE | LINK,
    BASE: FREE,
    LINK: GROUND | FIXED | FREE,
}
"""What a category collides with: all but links with links, and what never moves with its like."""

LINKS = BASE | LINK
"""What links collide with too, where those of a robot collide with each other."""


SLIPS = 1e-4
"""Slower contacts stick [m/s]; they have no direction worth the name."""

APART = 1e-5
"""Contacts of a mesh that are nearer to each other, along each axis, are one [m], where their
normals are `ALIKE`."""

ALIKE = 0.99
"""Cosine of the angle below which two normals are one."""


@dataclass
class Surface:
    """What contacts know of a shape.

    Attributes:
        body: of ODE, its origin the centre of mass; None for what is fixed.
        friction: Coulomb's coefficient.
        bounce: coefficient of restitution; a pair has the smaller one.
    """

    body: Any
    friction: float
    bounce: float = 0.0


@dataclass
class Part:
    """A body or link of the scene.

    A shape knows its surface and not its part: in a circle of them Python would destroy ODE's
    objects in any order, and ODE dies of that.

    Attributes:
        surface: of all its shapes.
        frame: of the scene's body or link, in the frame of ODE's body, or in the world.
    """

    surface: Surface
    frame: Pose = field(default_factory=Pose)
    geoms: list[Any] = field(default_factory=list)

    @property
    def body(self) -> Any:
        """Of ODE; None for what is fixed."""
        return self.surface.body

    def add(self, geom: Any, category: int, also: int = 0) -> None:
        """Make a geom one of its shapes; `also` are categories that it collides with besides."""
        geom.attribs["surface"] = self.surface
        library().dGeomSetCategoryBits(geom._id(), category)
        library().dGeomSetCollideBits(geom._id(), TOUCHES[category] | also)
        self.geoms.append(geom)


class Contacts:
    """The contact joints of one step.

    Args:
        erp, cfm: share of a penetration that is corrected in a step, and softness [m/(N s)].
        most: joints of a pair of shapes; the deepest contacts become joints.
        along: where a contact slips, all of its friction acts along the slip, as Coulomb's does.
            Otherwise ODE chooses two directions, and friction holds up to mu times the load in
            each of them, together up to 1.4 times that.
        rule: makes the friction of two surfaces that differ of theirs.

    Attributes:
        space: that all geoms are in.
        made: the joints of the last step, each with both surfaces; they stay until the next one, so
            that their forces can be asked for.
        apart: pairs of surfaces that do not collide, by their ids.
    """

    def __init__(
        self,
        world: Any,
        erp: float,
        cfm: float,
        most: int,
        along: bool,
        rule: Callable[[Any, Any], Any],
    ) -> None:
        self.world, self.erp, self.cfm, self.most, self.along = world, erp, cfm, most, along
        self.rule = rule
        self.space = ode.SimpleSpace()
        self.made: list[tuple[Any, Surface, Surface]] = []
        self.apart: set[frozenset[int]] = set()
        self._group = ode.JointGroup()
        # Not left to Python, which destroys worlds and joints in any order.
        weakref.finalize(self, _empty, self._group, self.made)
        self._soft = (erp, cfm) != (world.getERP(), world.getCFM())
        soft = ode.ContactSoftERP | ode.ContactSoftCFM if self._soft else 0
        self._mode, self._bouncy = ode.ContactApprox1 | soft, ode.ContactBounce
        self._collide, self._joint = ode.collide, ode.ContactJoint

    def make(self) -> None:
        """Find what touches and make joints of it, in place of those before."""
        self.clear()
        self.space.collide(None, self._near)

    def settle(self) -> None:
        """Have the space note what has moved. What moves next then comes first in its order, which
        is the order of the contacts, and so of the rows that the solver sums."""
        self.space.collide(None, lambda *pair: None)

    def clear(self) -> None:
        """Take the joints away."""
        _empty(self._group, self.made)

    def on(self, body: Any) -> int:
        """How many of the joints a body has."""
        return sum(body in (first.body, second.body) for _, first, second in self.made)

    def forces(self) -> Iterator[tuple[Surface, Surface, FloatArray]]:
        """Both surfaces of each joint, and the wrench of the second on the first in the last step,
        about the world's origin [N, N m], (6,). None of what fell asleep in it: ODE writes none."""
        for joint, first, second in self.made:
            if not _awake(first.body, second.body):
                continue
            if first.body is None:  # ODE's first body is one that can move
                first, second = second, first
            force, torque = map(np.array, joint.getFeedback()[:2])  # about its centre
            torque = torque + np.cross(first.body.getPosition(), force)
            yield first, second, np.concatenate([force, torque])

    def _near(self, _: Any, first: Any, second: Any) -> None:
        a, b = first.attribs["surface"], second.attribs["surface"]
        if self.apart and frozenset((id(a), id(b))) in self.apart:
            return
        one, other = a.body, b.body
        if not _awake(one, other):
            return
        contacts = self._collide(first, second)
        if len(contacts) > 1 and (isinstance(first, Mesh) or isinstance(second, Mesh)):
            contacts = distinct(contacts)
        if len(contacts) > self.most:
            contacts.sort(key=_depth, reverse=True)
            del contacts[self.most :]
        friction, bounce = a.friction, min(a.bounce, b.bounce)
        if friction != b.friction:
            friction = float(self.rule(friction, b.friction))
        world, group, joint = self.world, self._group, self._joint
        mode = self._mode | self._bouncy if bounce else self._mode
        along = ode.ContactFDir1 | ode.ContactMu2
        for contact in contacts:
            direction = _slip(contact, one, other) if self.along else None
            contact.setMode(mode if direction is None else mode | along)
            contact.setMu(friction)
            if direction is not None:
                contact.setFDir1(direction)
                contact.setMu2(0.0)
            if bounce:
                contact.setBounce(bounce)
            if self._soft:
                contact.setSoftERP(self.erp)
                contact.setSoftCFM(self.cfm)
            made = joint(world, group, contact)
            made.attach(one, other)
            made.setFeedback(True)
            self.made.append((made, a, b))


def _empty(group: Any, joints: list[tuple[Any, Surface, Surface]]) -> None:
    """Destroy the joints of a group; pyode crashes on one that is still asked for its forces."""
    for joint, *_ in joints:
        joint.setFeedback(False)
    joints.clear()
    group.empty()


def _awake(one: Any, other: Any) -> bool:
    """Whether one of two bodies is; None never moves."""
    return any(body is not None and body.isEnabled() for body in (one, other))


def _slip(contact: Any, one: Any, other: Any) -> tuple[float, float, float] | None:
    """Direction in which one body slips on the other where they touch; None where it sticks."""
    place, normal, *_ = contact.getContactGeomParams()
    slip = [0.0, 0.0, 0.0]
    for body, sign in ((one, 1.0), (other, -1.0)):
        if body is not None:
            velocity = body.getPointVel(place)
            slip = [s + sign * v for s, v in zip(slip, velocity, strict=True)]
    across = sum(s * n for s, n in zip(slip, normal, strict=True))
    x, y, z = (s - across * n for s, n in zip(slip, normal, strict=True))
    speed = math.sqrt(x * x + y * y + z * z)
    return (x / speed, y / speed, z / speed) if speed > SLIPS else None


def distinct(contacts: list[Any]) -> list[Any]:
    """One contact of each place and normal, the deepest, in the order of their depth."""
    kept: list[Any] = []
    seen: list[tuple[float, ...]] = []
    for contact in sorted(contacts, key=_depth, reverse=True):
        (x, y, z), (u, v, w), *_ = contact.getContactGeomParams()
        for a, b, c, d, e, f in seen:
            near = abs(x - a) <= APART and abs(y - b) <= APART and abs(z - c) <= APART
            if near and u * d + v * e + w * f > ALIKE:
                break
        else:
            kept.append(contact)
            seen.append((x, y, z, u, v, w))
    return kept


def _depth(contact: Any) -> float:
    depth: float = contact.getContactGeomParams()[2]
    return depth
