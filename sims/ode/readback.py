"""What ODE says that it built, for the parity check.

ODE tells no corners of a mesh, so each is measured: a plane is moved towards it until it touches.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from pytest_simbench.description.links import subspace
from pytest_simbench.description.shapes import (
    DIRECTIONS,
    Outline,
    a_box,
    a_cylinder,
    a_round,
    placed,
)
from pytest_simbench.parity import readback
from pytest_simbench.parity.readback import felt
from pytest_simbench.scene import Coupling, FloatArray, Pose
from pytest_simbench.simulator import lazy_import

from .axes import Axis
from .contacts import Part
from .library import HI_STOP, LO_STOP, MOST_FORCE, SOFTNESS, Convex, Mesh, damping, library, pose_of

ode = lazy_import("ode")


class ReadBack(readback.ReadBack):
    """Reads the quantities of `parity.quantities` that ODE tells."""

    def __init__(self, simulator: Any) -> None:
        super().__init__(simulator, simulator._ground, simulator._bodies, simulator._links)
        self.made, self.timestep = simulator.world, simulator.settings.timestep
        self.axes, self.drives = simulator._axes, simulator._drives
        self.contacts, self.loops = simulator.contacts, simulator._closures
        self.probe = ode.GeomPlane(None, (0.0, 0.0, 1.0), 0.0)
        self.first = {id(self.bodies[b.name]): b.parts[0].pose for b in self.scene.bodies}

    def world(self) -> dict[str, Any]:
        (_, _, up), height = self.ground.geoms[0].getParams()
        return {
            "gravity": self.made.getGravity(),
            "timestep": self.timestep,
            "ground/height": height / up,
        }

    def body(self, part: Part, name: str) -> dict[str, Any]:
        if part.body is None or part.body.isKinematic():
            return {"dynamic": 0.0}
        velocity = [*part.body.getLinearVel(), *part.body.getAngularVel()]
        held = part.body.getNumJoints() > self.contacts.on(part.body)
        return {"dynamic": float(not held), "velocity": velocity, **self.inertial(part)}

    def closures(self) -> list[tuple[FloatArray, bool]]:
        return [(self._points(joint), isinstance(joint, ode.HingeJoint)) for joint in self.loops]

    def coupled(self, pairs: tuple[Coupling, ...]) -> bool:
        return all(self.drives.pinions[pair.follower].holds for pair in pairs)

    def pose(self, part: Part) -> FloatArray:
        return self._frame(part).as_array()

    def shapes(self, part: Part) -> Iterator[Outline]:
        frame = self._frame(part)
        for geom in part.geoms:
            if isinstance(geom, Mesh | Convex):
                yield "meshes", self._measured(geom, frame)
                continue
            pose = frame.inverse() * pose_of(geom)
            if isinstance(geom, ode.GeomBox):
                yield a_box(geom.getLengths(), pose)
            elif isinstance(geom, ode.GeomSphere):
                yield a_round(geom.getRadius(), 0.0, pose)
            else:
                outline = a_cylinder if isinstance(geom, ode.GeomCylinder) else a_round
                radius, length = geom.getParams()
                yield outline(radius, length, pose)

    def surface(self, part: Part) -> dict[str, Any]:
        return {"friction": part.surface.friction, "restitution": part.surface.bounce}

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
        """The scene's frame of a body or link, in the world; of a fixed body as its first shape has
        it."""
        if part.body is not None:
            place = [*part.body.getPosition(), *part.body.getQuaternion()]
            return Pose.from_array(place) * part.frame
        if id(part) in self.first:
            return pose_of(part.geoms[0]) * self.first[id(part)].inverse()
        return part.frame

    def inertial(self, part: Part) -> dict[str, Any]:
        mass, frame = part.body.getMass(), part.frame.inverse()
        force = np.array(part.body.getForce())
        return {
            "mass": mass.mass,
            "com": placed(np.array([mass.c]), frame)[0],
            "inertia": frame.rotation() @ np.array(mass.I) @ frame.rotation().T,
            "gravity": part.body.getGravityMode() + felt(force, mass.mass, self.made.getGravity()),
            "damping": damping(part.body) / self.timestep,
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

    def joint(self, name: str) -> dict[str, Any]:
        axis, drives = self.axes[name], self.drives
        joint = axis.joint
        limits = np.array([axis.stops.getParam(LO_STOP), axis.stops.getParam(HI_STOP)])
        resistance = 1 / joint.getParam(SOFTNESS)
        stiffness = resistance * drives.gain(axis)
        found: dict[str, Any] = {
            "axis": _motion(axis, self._frame(self._child(axis))),
            "limits": limits + axis.zero,
            "initial_position": axis.position(),
            "effort_limit": joint.getParam(MOST_FORCE),
            "stiffness": stiffness,
            "damping": resistance - self.timestep * stiffness,
            "armature": 0.0,
            "friction": 0.0,
        }
        passive = drives.passive[name]
        if passive.damper is not None:
            resistance = 1 / passive.damper.getParam(SOFTNESS)
            found["stiffness"] += resistance * passive.gain
            found["damping"] += resistance * (1 - passive.ahead * passive.gain)
        if passive.brake is not None:
            found["friction"] = passive.brake.getParam(MOST_FORCE)
        if passive.rotor is not None:
            found["armature"] = self.timestep / passive.rotor.getParam(SOFTNESS)
        for pair in self.prepared.robot.gripper.couplings:
            pinion = drives.pinions[pair.follower]
            if passive.rotor is None and axis in pinion.joints:
                found["armature"] = pinion.inertia / 2
        return found

    def _child(self, axis: Axis) -> Part:
        return next(part for part in self.links.values() if part.body is axis.child)

    def collide(self, first: Part, second: Part) -> Any:
        if frozenset((id(first.surface), id(second.surface))) in self.contacts.apart:
            return ()
        return [[_collide(x._id(), y._id()) for y in second.geoms] for x in first.geoms]


def _collide(x: int, y: int) -> bool:
    """Whether ODE asks about a pair of geoms: both enabled, and one wants the other's category."""
    tell = library()
    wanted = tell.dGeomGetCategoryBits(x) & tell.dGeomGetCollideBits(y)
    wanted |= tell.dGeomGetCategoryBits(y) & tell.dGeomGetCollideBits(x)
    return bool(wanted and tell.dGeomIsEnabled(x) and tell.dGeomIsEnabled(y))


def _motion(axis: Axis, frame: Pose) -> FloatArray:
    """Velocity of the child's frame at unit joint speed, in that frame: angular, linear, (6,)."""
    turn, direction = frame.rotation().T, np.array(axis.joint.getAxis())
    anchor = axis.joint.getAnchor() if axis.hinged else frame.position
    return subspace(
        turn @ direction, turn @ np.subtract(anchor, frame.position), slides=not axis.hinged
    )
