"""What DART says that it built, for the parity check.

DART tells no corners of a mesh, so each mesh is measured: by its distance from a large box, found
with a collision detector (FCL, exact) that the world does not use. A Mico2 arm takes 4 s, so a
process measures a mesh of one file, scale, bounding box and place in its body once.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np

from pytest_simbench.description.shapes import DIRECTIONS, Outline, a_box, a_cylinder, a_round
from pytest_simbench.parity import readback
from pytest_simbench.parity.readback import felt, one_value
from pytest_simbench.scene import Coupling, FloatArray, Pose
from pytest_simbench.simulator import lazy_import

dartpy = lazy_import("dartpy")

_MEASURED: dict[tuple[str, bytes], FloatArray] = {}
_PROBE, _AWAY = 2.0, 3.0
"""Edge of the box that measures, and how far from a mesh's origin its face stands [m]."""


class ReadBack(readback.ReadBack):
    """Reads the quantities of `parity.quantities` that DART tells."""

    def __init__(self, simulator: Any) -> None:
        self.made, self.robot = simulator.world, simulator._robot
        links = [] if self.robot is None else self.robot.getBodyNodes()
        links = {body.getName(): body for body in links}
        super().__init__(simulator, simulator._ground, simulator._bodies, links)
        self.detector = dartpy.collision.FCLCollisionDetector()
        self.toucher = dartpy.collision.OdeCollisionDetector()
        self.objects: dict[Any, list[Any]] = {}
        self.groups: list[Any] = []
        self.probe = dartpy.dynamics.SimpleFrame(dartpy.dynamics.Frame.World(), "probe")
        self.probe.setShape(dartpy.dynamics.BoxShape(np.full(3, _PROBE)))

    def world(self) -> dict[str, Any]:
        plane = self.ground.getShapeNode(0)
        shape = plane.getShape()
        slab = isinstance(shape, dartpy.dynamics.BoxShape)
        top = shape.getSize()[2] / 2 if slab else shape.getOffset()
        return {
            "gravity": self.made.getGravity(),
            "timestep": self.made.getTimeStep(),
            "ground/height": top + plane.getWorldTransform().translation()[2],
        }

    def pose(self, part: Any) -> FloatArray:
        place = part.getWorldTransform()
        return np.concatenate([place.translation(), place.quaternion().wxyz()])

    def shapes(self, part: Any) -> Iterator[Outline]:
        kinds, place = dartpy.dynamics, part.getWorldTransform()
        for shape in _colliding(part):
            own, solid = place.inverse().multiply(shape.getWorldTransform()), shape.getShape()
            pose = Pose.from_array([*own.translation(), *own.quaternion().wxyz()])
            if isinstance(solid, kinds.BoxShape):
                yield a_box(solid.getSize(), pose)
            elif isinstance(solid, kinds.SphereShape):
                yield a_round(solid.getRadius(), 0.0, pose)
            elif isinstance(solid, kinds.CapsuleShape):
                yield a_round(solid.getRadius(), solid.getHeight(), pose)
            elif isinstance(solid, kinds.CylinderShape):
                yield a_cylinder(solid.getRadius(), solid.getHeight(), pose)
            else:
                yield "meshes", self._measured(shape, place)

    def surface(self, part: Any) -> dict[str, Any]:
        surfaces = [shape.getDynamicsAspect() for shape in _colliding(part)]
        return {
            "friction": one_value([s.getFrictionCoeff() for s in surfaces]),
            "restitution": one_value([s.getRestitutionCoeff() ** 2 for s in surfaces]),
        }

    def inertial(self, part: Any) -> dict[str, Any]:
        inertia, gravity = part.getInertia(), self.made.getGravity()
        pull = 0.0
        if part.getName() in self.links:  # bodies are pushed otherwise
            pull = felt(part.getExternalForceGlobal()[3:], inertia.getMass(), gravity)
        return {
            "mass": inertia.getMass(),
            "com": inertia.getLocalCOM(),
            "inertia": inertia.getMoment(),
            "gravity": part.getGravityMode() + pull,
        }

    def body(self, part: Any, name: str) -> dict[str, Any]:
        joint, kinds = part.getParentJoint(), dartpy.dynamics.ActuatorType
        driven = joint.getActuatorType() in {kinds.FORCE, kinds.PASSIVE}
        mobile = part.getSkeleton().isMobile() and joint.getNumDofs() == 6
        found: dict[str, Any] = {"dynamic": float(mobile and driven)}
        if joint.getNumDofs() and driven:
            found |= self.inertial(part)
            speeds = [part.getCOMLinearVelocity(), part.getAngularVelocity()]
            found["velocity"] = np.concatenate(speeds)
            passive = np.array([joint.getDampingCoefficient(k) for k in range(6)])
            largest = np.array([passive[3:].max(), passive[:3].max()])
            found["damping"] = largest / [found["mass"], found["inertia"].max()]
        return found

    def joint(self, name: str) -> dict[str, Any]:
        joint = self.robot.getJoint(name)
        forces = [-joint.getForceLowerLimit(0), joint.getForceUpperLimit(0)]
        passive = {
            "passive_damping": joint.getDampingCoefficient(0),
            "spring": joint.getSpringStiffness(0),
        }
        stray = sum(value for word, value in passive.items() if word not in self.scene.words)
        limits = [joint.getPositionLowerLimit(0), joint.getPositionUpperLimit(0)]
        rest = {"rest": joint.getRestPosition(0)} if passive["spring"] else {}
        return rest | {
            "axis": np.ravel(joint.getRelativeJacobian()),
            "limits": limits if joint.areLimitsEnforced() else [-np.inf, np.inf],
            "effort_limit": one_value(forces),
            "friction": joint.getCoulombFriction(0) + stray,  # all that is not the servo's
            "initial_position": joint.getPosition(0),
        }

    def coupled(self, pairs: tuple[Coupling, ...]) -> bool:
        mimic = dartpy.dynamics.ActuatorType.MIMIC
        return all(self.robot.getJoint(p.follower).getActuatorType() == mimic for p in pairs)

    def _measured(self, shape: Any, place: Any) -> FloatArray:
        """The reach of a mesh in the frame of its body, which is at `place`; see the module."""
        solid = shape.getShape()
        if not isinstance(solid, dartpy.dynamics.MeshShape):
            return self._measure(shape, place)
        box, within = solid.getBoundingBox(), shape.getRelativeTransform().matrix()
        numbers = np.concatenate([solid.getScale(), box.getMin(), box.getMax(), within.ravel()])
        mesh = solid.getMeshPath(), numbers.tobytes()
        if mesh not in _MEASURED:
            _MEASURED[mesh] = self._measure(shape, place)
        return _MEASURED[mesh]

    def _measure(self, shape: Any, place: Any) -> FloatArray:
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

    def collide(self, first: Any, second: Any) -> Any:
        """Asks the world's own filter."""
        kept = self.made.getConstraintSolver().getCollisionOption().collisionFilter
        pairs = product(self._objects(first), self._objects(second))
        return [not kept.ignoresCollision(*pair) for pair in pairs]

    def _objects(self, body: Any) -> list[Any]:
        """What a filter is asked about, one of each shape. Contacts alone tell it, so the shape is
        put into the probe."""
        if body not in self.objects:
            self.objects[body] = [self._object(shape) for shape in _colliding(body)]
        return self.objects[body]

    def _object(self, shape: Any) -> Any:
        group, found = self.toucher.createCollisionGroup(), dartpy.collision.CollisionResult()
        self.probe.setRelativeTransform(shape.getWorldTransform())
        for frame in (shape, self.probe):
            group.addShapeFrame(frame)
        group.collide(dartpy.collision.CollisionOption(True, 1), found)
        self.groups.append(group)  # to which the objects belong
        ends = found.getContact(0).collisionObject1, found.getContact(0).collisionObject2
        return next(end for end in ends if end.getShapeFrame().asShapeNode() is not None)


def _colliding(body: Any) -> list[Any]:
    return [shape for shape in body.getShapeNodes() if shape.hasCollisionAspect()]


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
