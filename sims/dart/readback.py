"""What DART says that it built, for the parity check.

DART tells no corners of a mesh, so each mesh is measured: by its distance from a large box, found
with a collision detector (FCL, exact) that the world does not use.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pytest_simbench.description.shapes import (
    DIRECTIONS,
    box_corners,
    cylinder_reach,
    outlines,
    reach,
    round_reach,
)
from pytest_simbench.parity import readback
from pytest_simbench.parity.readback import one_value
from pytest_simbench.scene import FloatArray, Pose
from pytest_simbench.simulator import lazy_import

dartpy = lazy_import("dartpy")

_PROBE, _AWAY = 2.0, 3.0
"""Edge of the box that measures, and how far from a mesh's origin its face stands [m]."""


class ReadBack(readback.ReadBack):
    """Reads the quantities of `parity.quantities` that DART tells."""

    def __init__(self, simulator: Any) -> None:
        super().__init__(simulator)
        self.ground, self.bodies = simulator._ground, simulator._bodies
        self.made, self.robot = simulator.world, simulator._robot
        self.detector = dartpy.collision.FCLCollisionDetector()
        self.probe = dartpy.dynamics.SimpleFrame(dartpy.dynamics.Frame.World(), "probe")
        self.probe.setShape(dartpy.dynamics.BoxShape(np.full(3, _PROBE)))

    def world(self) -> dict[str, Any]:
        plane = self.ground.getShapeNode(0)
        surface = plane.getDynamicsAspect()
        top = plane.getShape().getSize()[2] / 2 if _is_box(plane) else plane.getShape().getOffset()
        return {
            "gravity": self.made.getGravity(),
            "timestep": self.made.getTimeStep(),
            "ground/friction": surface.getFrictionCoeff(),
            "ground/restitution": surface.getRestitutionCoeff() ** 2,
            "ground/height": top + plane.getWorldTransform().translation()[2],
        }

    def link(self, prefix: str, name: str) -> dict[str, Any]:
        body = self.robot.getBodyNode(name)
        found = self._part(prefix, body, body.getWorldTransform())
        return found if name == self.prepared.root else found | _inertial(prefix, body)

    def joint(self, prefix: str, name: str) -> dict[str, Any]:
        return _joint(prefix, self.robot.getJoint(name))

    def coupled(self, pairs: tuple[tuple[str, str], ...]) -> bool:
        mimic = dartpy.dynamics.ActuatorType.MIMIC
        return all(self.robot.getJoint(other).getActuatorType() == mimic for _, other in pairs)

    def body(self, prefix: str, name: str) -> dict[str, Any]:
        """A body; its frame is that of DART's."""
        body = self.bodies[name]
        joint = body.getParentJoint()
        found = self._part(prefix, body, body.getWorldTransform())
        mobile = body.getSkeleton().isMobile() and joint.getNumDofs() == 6
        driven = {dartpy.dynamics.ActuatorType.FORCE, dartpy.dynamics.ActuatorType.PASSIVE}
        found[f"{prefix}/dynamic"] = float(mobile and joint.getActuatorType() in driven)
        if joint.getNumDofs() and joint.getActuatorType() in driven:
            found |= _inertial(prefix, body)
            speeds = [body.getCOMLinearVelocity(), body.getAngularVelocity()]
            found[f"{prefix}/velocity"] = np.concatenate(speeds)
            passive = np.array([joint.getDampingCoefficient(k) for k in range(6)])
            largest = np.array([passive[3:].max(), passive[:3].max()])
            inertia = body.getInertia()
            found[f"{prefix}/damping"] = largest / [inertia.getMass(), inertia.getMoment().max()]
        return found

    def _part(self, prefix: str, body: Any, place: Any) -> dict[str, Any]:
        """Pose, shapes and surface of a body."""
        shapes = _colliding(body)
        position, turn = place.translation(), place.quaternion().wxyz()
        found = {f"{prefix}/pose": np.concatenate([position, turn])}
        boxes = [self._reach(shape, place) for shape in shapes if _is_box(shape)]
        rounds = [_round(shape, place) for shape in shapes if _is_round(shape)]
        others = (shape for shape in shapes if not (_is_box(shape) or _is_round(shape)))
        meshes = [self._reach(shape, place) for shape in others]
        found |= outlines(prefix, boxes, meshes, rounds)
        if shapes:
            surfaces = [shape.getDynamicsAspect() for shape in shapes]
            found[f"{prefix}/friction"] = one_value([s.getFrictionCoeff() for s in surfaces])
            found[f"{prefix}/restitution"] = one_value(
                [s.getRestitutionCoeff() ** 2 for s in surfaces]
            )
        return found

    def _reach(self, shape: Any, place: Any) -> FloatArray:
        """The reach of a shape in the frame at `place`."""
        if _is_box(shape):
            own = shape.getWorldTransform()
            corners = box_corners(shape.getShape().getSize()) @ own.rotation().T
            return reach((corners + own.translation() - place.translation()) @ place.rotation())
        group = self.detector.createCollisionGroup()
        group.addShapeFrame(shape)
        group.addShapeFrame(self.probe)
        option = dartpy.collision.DistanceOption(False, -1.0)
        centre, reaches = shape.getWorldTransform().translation(), []
        directions = DIRECTIONS @ place.rotation().T
        for direction in directions:
            self.probe.setRelativeTransform(_facing(direction, centre))
            reaches.append(_AWAY - group.distance(option))
        return np.array(reaches) + directions @ (centre - place.translation())

    def can_touch(self, a: str, b: str) -> bool:
        first, second = self._body(a), self._body(b)
        if not (first.isCollidable() and second.isCollidable()):
            return False
        shapes = [*_colliding(first), *_colliding(second)]
        if not all(shape.getCollisionAspect().isCollidable() for shape in shapes):
            return False
        if first.getSkeleton() is second.getSkeleton() or a[:4] == b[:4] == "link":
            skeleton = first.getSkeleton()
            return bool(
                skeleton.isEnabledSelfCollisionCheck()
                and (skeleton.isEnabledAdjacentBodyCheck() or not _adjacent(first, second))
            )
        return True

    def _body(self, name: str) -> Any:
        kind, _, rest = name.partition("/")
        if kind == "ground":
            return self.ground
        return self.bodies[rest] if kind == "body" else self.robot.getBodyNode(rest)


def _adjacent(first: Any, second: Any) -> bool:
    """Whether one joint joins two bodies."""
    above = (first.getParentBodyNode(), second.getParentBodyNode())
    return second is above[0] or first is above[1]


def _colliding(body: Any) -> list[Any]:
    return [shape for shape in body.getShapeNodes() if shape.hasCollisionAspect()]


def _is_box(shape: Any) -> bool:
    return isinstance(shape.getShape(), dartpy.dynamics.BoxShape)


def _is_round(shape: Any) -> bool:
    kinds = dartpy.dynamics
    return isinstance(
        shape.getShape(), kinds.SphereShape | kinds.CylinderShape | kinds.CapsuleShape
    )


def _round(shape: Any, place: Any) -> FloatArray:
    """The reach of a sphere, cylinder or capsule in the frame at `place`."""
    own, solid = place.inverse().multiply(shape.getWorldTransform()), shape.getShape()
    pose = Pose.from_array([*own.translation(), *own.quaternion().wxyz()])
    length = getattr(solid, "getHeight", float)()
    pillar = isinstance(solid, dartpy.dynamics.CylinderShape)
    return (cylinder_reach if pillar else round_reach)(solid.getRadius(), length, pose)


def _inertial(prefix: str, body: Any) -> dict[str, Any]:
    inertia = body.getInertia()
    return {
        f"{prefix}/mass": inertia.getMass(),
        f"{prefix}/com": inertia.getLocalCOM(),
        f"{prefix}/inertia": inertia.getMoment(),
        f"{prefix}/gravity": float(body.getGravityMode()),
    }


def _joint(prefix: str, joint: Any) -> dict[str, Any]:
    forces = [-joint.getForceLowerLimit(0), joint.getForceUpperLimit(0)]
    passive = joint.getCoulombFriction(0) + joint.getDampingCoefficient(0)
    limits = [joint.getPositionLowerLimit(0), joint.getPositionUpperLimit(0)]
    return {
        f"{prefix}/axis": np.ravel(joint.getRelativeJacobian()),
        f"{prefix}/limits": limits if joint.areLimitsEnforced() else [-np.inf, np.inf],
        f"{prefix}/effort_limit": one_value(forces),
        f"{prefix}/friction": passive + joint.getSpringStiffness(0),  # all that is not the servo's
        f"{prefix}/initial_position": joint.getPosition(0),
    }


def _facing(direction: FloatArray, origin: FloatArray) -> Any:
    """Pose of the probe whose face is `_AWAY` from `origin` along `direction`, and looks back."""
    other = np.eye(3)[np.argmin(np.abs(direction))]
    x = np.cross(direction, other)
    x /= np.linalg.norm(x)
    pose = dartpy.math.Isometry3()
    pose.set_rotation(np.column_stack([x, np.cross(direction, x), direction]))
    # Just opposite a corner of a cube, FCL (GJK) takes its middle for the nearest point.
    aside = 0.137 * x + 0.211 * np.cross(direction, x)
    pose.set_translation(origin + direction * (_AWAY + _PROBE / 2) + aside)
    return pose
