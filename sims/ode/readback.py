"""What ODE says that it built, for the parity check.

ODE tells no corners of a mesh, so each is measured: a plane is moved towards it until it touches.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pytest_simbench.description.shapes import (
    DIRECTIONS,
    box_corners,
    cylinder_reach,
    outlines,
    placed,
    reach,
    round_reach,
)
from pytest_simbench.parity import readback
from pytest_simbench.scene import FloatArray, Pose
from pytest_simbench.simulator import lazy_import

from .axes import Axis
from .contacts import Part
from .library import (
    HI_STOP,
    LO_STOP,
    MOST_FORCE,
    SOFTNESS,
    Convex,
    Mesh,
    damping,
    library,
    pose_of,
)

ode = lazy_import("ode")


class ReadBack(readback.ReadBack):
    """Reads the quantities of `parity.quantities` that ODE tells."""

    def __init__(self, simulator: Any) -> None:
        super().__init__(simulator)
        self.made, self.timestep = simulator.world, simulator.settings.timestep
        self.ground, self.bodies, self.links = (
            simulator._ground, simulator._bodies, simulator._links,
        )  # fmt: skip
        self.axes, self.drives = simulator._axes, simulator._drives
        self.contacts, self.loops = simulator.contacts, simulator._closures
        self.probe = ode.GeomPlane(None, (0.0, 0.0, 1.0), 0.0)

    def world(self) -> dict[str, Any]:
        (_, _, up), height = self.ground.geoms[0].getParams()
        return {
            "gravity": self.made.getGravity(),
            "timestep": self.timestep,
            "ground/friction": self.ground.surface.friction,
            "ground/restitution": self.ground.surface.bounce,
            "ground/height": height / up,
        }

    def body(self, prefix: str, name: str) -> dict[str, Any]:
        part = self.bodies[name]
        first = self.scene.body(name).parts[0].pose
        found = self._part(prefix, part, first)
        free = part.body is not None and not part.body.isKinematic()
        if free:
            found[f"{prefix}/velocity"] = [*part.body.getLinearVel(), *part.body.getAngularVel()]
        held = free and part.body.getNumJoints() > self.contacts.on(part.body)
        found[f"{prefix}/dynamic"] = float(free and not held)
        return found

    def link(self, prefix: str, name: str) -> dict[str, Any]:
        return self._part(prefix, self.links[name])

    def closures(self) -> list[FloatArray]:
        return [self._points(joint) for joint in self.loops]

    def coupled(self, pairs: tuple[tuple[str, str], ...]) -> bool:
        return bool(self.drives.pinion.holds if self.drives.pinion else not pairs)

    def _part(self, prefix: str, part: Part, first: Pose | None = None) -> dict[str, Any]:
        """Pose, shapes, surface and inertia of a body or link; `first`: of a body, the pose of its
        first shape in its frame."""
        frame = self._frame(part)
        if part.body is None and first is not None:
            frame *= first.inverse()
        found: dict[str, Any] = {f"{prefix}/pose": frame.as_array()}
        meshes = [self._measured(geom, frame) for geom in part.geoms if isinstance(geom, _FACETED)]
        boxes = [
            reach(placed(box_corners(geom.getLengths()), frame.inverse() * pose_of(geom)))
            for geom in part.geoms
            if isinstance(geom, ode.GeomBox)
        ]
        others = (geom for geom in part.geoms if not isinstance(geom, (*_FACETED, ode.GeomBox)))
        rounds = [_round(geom, frame.inverse() * pose_of(geom)) for geom in others]
        found |= outlines(prefix, boxes, meshes, rounds)
        if part.geoms:
            found[f"{prefix}/friction"] = part.surface.friction
            found[f"{prefix}/restitution"] = part.surface.bounce
        if part.body is not None and not part.body.isKinematic():
            found |= self._inertial(prefix, part)
        return found

    def _points(self, joint: Any) -> FloatArray:
        """Of a closure, in the frames of its links, (2, 3)."""
        bodies = joint.getBody(0), joint.getBody(1)
        parts = (next(part for part in self.links.values() if part.body is body) for body in bodies)
        points = joint.getAnchor(), joint.getAnchor2()
        return np.concatenate(
            [
                placed(np.array([point]), self._frame(part).inverse())
                for part, point in zip(parts, points, strict=True)
            ]
        )

    def _frame(self, part: Part) -> Pose:
        """The scene's frame of a body or link, in the world."""
        if part.body is not None:
            return _pose(part.body) * part.frame
        if part in self.bodies.values():
            return pose_of(part.geoms[0])
        return part.frame

    def _inertial(self, prefix: str, part: Part) -> dict[str, Any]:
        mass, frame = part.body.getMass(), part.frame.inverse()
        return {
            f"{prefix}/mass": mass.mass,
            f"{prefix}/com": placed(np.array([mass.c]), frame)[0],
            f"{prefix}/inertia": frame.rotation() @ np.array(mass.I) @ frame.rotation().T,
            f"{prefix}/gravity": float(part.body.getGravityMode()),
            f"{prefix}/damping": damping(part.body) / self.timestep,
        }

    def _measured(self, mesh: Mesh | Convex, frame: Pose) -> FloatArray:
        """The reach of a mesh in a frame: how far a plane stands off when it just touches."""
        origin, centre = np.asarray(frame.position), np.asarray(pose_of(mesh).position)
        reaches = []
        for direction in DIRECTIONS @ frame.rotation().T:
            normal, offset = -direction, centre @ direction
            if isinstance(mesh, Mesh):  # from outside: every corner is below such a plane
                offset -= 10.0  # a hull touches none of those, and its own centre is within
            while True:
                self.probe.setParams(tuple(normal), -offset)
                depths = [c.getContactGeomParams()[2] for c in ode.collide(mesh, self.probe)]
                if not depths or max(depths) <= 1e-12:
                    break
                offset += max(depths)
            reaches.append(offset - origin @ direction)
        return np.array(reaches)

    def joint(self, prefix: str, name: str) -> dict[str, Any]:
        axis, drives = self.axes[name], self.drives
        joint = axis.joint
        limits = np.array([axis.stops.getParam(LO_STOP), axis.stops.getParam(HI_STOP)])
        resistance = 1 / joint.getParam(SOFTNESS)
        stiffness = resistance * drives.gain(axis)
        found: dict[str, Any] = {
            f"{prefix}/axis": _motion(axis, self._frame(self._child(axis))),
            f"{prefix}/limits": limits + axis.zero,
            f"{prefix}/initial_position": axis.position(),
            f"{prefix}/effort_limit": joint.getParam(MOST_FORCE),
            f"{prefix}/stiffness": stiffness,
            f"{prefix}/damping": resistance - self.timestep * stiffness,
            f"{prefix}/armature": 0.0,
        }
        if name in drives.rotors:
            softness = drives.rotors[name].motor.getParam(SOFTNESS)
            found[f"{prefix}/armature"] = self.timestep / softness
        elif drives.pinion is not None and axis in drives.pinion.fingers:
            found[f"{prefix}/armature"] = drives.pinion.inertia / len(drives.pinion.fingers)
        return found

    def _child(self, axis: Axis) -> Part:
        return next(part for part in self.links.values() if part.body is axis.child)

    def can_touch(self, a: str, b: str) -> bool:
        one, other = self._named(a), self._named(b)
        if frozenset((id(one.surface), id(other.surface))) in self.contacts.apart:
            return False
        pairs = [(x, y) for x in one.geoms for y in other.geoms]
        return all(_collide(x._id(), y._id()) for x, y in pairs)

    def _named(self, name: str) -> Part:
        kind, _, rest = name.partition("/")
        if kind == "ground":
            return self.ground
        return self.bodies[rest] if kind == "body" else self.links[rest]


_FACETED = (Mesh, Convex)


def _collide(x: int, y: int) -> bool:
    """Whether ODE asks about a pair of geoms: both enabled, and one wants the other's category."""
    tell = library()
    wanted = tell.dGeomGetCategoryBits(x) & tell.dGeomGetCollideBits(y)
    wanted |= tell.dGeomGetCategoryBits(y) & tell.dGeomGetCollideBits(x)
    return bool(wanted and tell.dGeomIsEnabled(x) and tell.dGeomIsEnabled(y))


def _round(geom: Any, pose: Pose) -> FloatArray:
    """The reach of a sphere, cylinder or capsule at a pose."""
    if isinstance(geom, ode.GeomSphere):
        return round_reach(geom.getRadius(), 0.0, pose)
    radius, length = geom.getParams()
    pillar = isinstance(geom, ode.GeomCylinder)
    return (cylinder_reach if pillar else round_reach)(radius, length, pose)


def _pose(body: Any) -> Pose:
    return Pose.from_array([*body.getPosition(), *body.getQuaternion()])


def _motion(axis: Axis, frame: Pose) -> FloatArray:
    """Velocity of the child's frame at unit joint speed, in that frame: angular, linear, (6,)."""
    turn, direction = frame.rotation().T, np.array(axis.joint.getAxis())
    if not axis.hinged:
        return np.concatenate([np.zeros(3), turn @ direction])
    arm = np.asarray(frame.position) - axis.joint.getAnchor()
    return np.concatenate([turn @ direction, turn @ np.cross(direction, arm)])
