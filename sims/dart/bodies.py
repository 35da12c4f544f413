"""The ground and the bodies of a scene in DART's world; and joints of a robot that move together,
beside its fingers.

DART's own coupler lets the follower trail by 2.5 steps, and throws one whose inertia, times the
square of the ratio, exceeds the leader's. So impulses on both joints, before each step, bring them
together at its end, with the masses and accelerations that DART tells.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pytest_simbench.description.shapes import write_obj
from pytest_simbench.description.urdf import body_urdf
from pytest_simbench.scene import Body, Box, Capsule, ConvexMesh, Coupling, Cylinder, Pose, Sphere
from pytest_simbench.simulator import NotSupportedError, lazy_import

dartpy = lazy_import("dartpy")

SLAB = (100.0, 100.0, 1.0)
"""Edges of a ground that is a box [m]; no room of a scene goes so far."""

ONE_CONTACT_ON_A_PLANE = ("fcl", "dart")
"""The detectors that tell one contact of a box on a plane. A box that was pushed rocks on it, and
sinks by 1 to 3 mm/s: all 20 throws of `default` ended 50 to 105 mm deep in the ground. Of a box on
a box they tell four."""


def add_ground(world: Any, friction: float, restitution: float, slab: bool = False) -> Any:
    """The body of the plane z = 0, made in the world.

    Args:
        slab: make it a box below z = 0 (`ONE_CONTACT_ON_A_PLANE`).
    """
    skeleton = dartpy.dynamics.Skeleton("ground")
    _, body = skeleton.createWeldJointAndBodyNodePair()
    if slab:
        shape = body.createShapeNode(dartpy.dynamics.BoxShape(np.array(SLAB)))
        shape.setRelativeTranslation([0.0, 0.0, -SLAB[2] / 2])
    else:
        shape = body.createShapeNode(dartpy.dynamics.PlaneShape([0.0, 0.0, 1.0], 0.0))
    set_surface(shape, friction, restitution)
    skeleton.setMobile(False)
    world.addSkeleton(skeleton)
    return body


def add_body(world: Any, box: Body) -> Any:
    """The body of a skeleton of its own, made in the world."""
    dynamics = dartpy.dynamics
    skeleton = dynamics.Skeleton(box.name)
    place = _isometry(box.pose)
    if box.fixed:
        joint, body = skeleton.createWeldJointAndBodyNodePair()
        joint.setTransformFromParentBodyNode(place)
        skeleton.setMobile(False)
    else:
        joint, body = skeleton.createFreeJointAndBodyNodePair()
        if box.prescribed:
            joint.setActuatorType(dynamics.ActuatorType.VELOCITY)
        else:
            inertia = dynamics.Inertia()
            inertia.setMass(box.mass)
            inertia.setMoment(np.diag(box.inertia()))
            body.setInertia(inertia)
        joint.setPositions(dynamics.FreeJoint.convertToPositions(place))
        damping = [*(box.angular_damping * box.inertia()), *[box.linear_damping * box.mass] * 3]
        for k, value in enumerate(damping):
            joint.setDampingCoefficient(k, value)
        joint.setLinearVelocity(np.array(box.linear_velocity))
        joint.setAngularVelocity(np.array(box.angular_velocity))
    for part in box.parts:
        shape = body.createShapeNode(_shape(part))
        shape.setRelativeTransform(_isometry(part.pose))
        shape.createVisualAspect().setColor(list(box.colour))
        set_surface(shape, box.friction, box.restitution)
    world.addSkeleton(skeleton)
    return body


def _isometry(pose: Pose) -> Any:
    """DART's transform of a pose."""
    place = dartpy.math.Isometry3()
    place.set_translation(np.array(pose.position))
    place.set_rotation(pose.rotation())
    return place


def _shape(body: Body) -> Any:
    match body:
        case Box():
            return dartpy.dynamics.BoxShape(np.array(body.size))
        case Sphere():
            return dartpy.dynamics.SphereShape(body.radius)
        case Cylinder():
            return dartpy.dynamics.CylinderShape(body.radius, body.length)
        case Capsule():
            return dartpy.dynamics.CapsuleShape(body.radius, body.length)
        case ConvexMesh():
            return _mesh(body)
    raise NotSupportedError(f"dart has no {type(body).__name__}")


def _mesh(body: ConvexMesh) -> Any:
    """The shape of a mesh. dartpy makes one only of a file that a URDF names."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mesh.urdf"
        text = body_urdf(body, lambda _, hull: write_obj(path.with_suffix(".obj"), hull))
        path.write_text(text, encoding="utf-8")
        skeleton = dartpy.utils.DartLoader().parseSkeleton(str(path))
    return skeleton.getBodyNode(0).getShapeNode(0).getShape()


def set_surface(shape: Any, friction: float, restitution: float = 0.0) -> None:
    """Friction and restitution of a shape; of a pair, DART takes the smaller friction, and the
    product of both restitutions."""
    if not shape.hasCollisionAspect():
        shape.createCollisionAspect()
    if not shape.hasDynamicsAspect():
        shape.createDynamicsAspect()
    shape.getDynamicsAspect().setFrictionCoeff(friction)
    shape.getDynamicsAspect().setRestitutionCoeff(math.sqrt(restitution))


class Couplings:
    """Holds q_follower - ratio q_leader at the offset."""

    def __init__(self, skeleton: Any, names: Sequence[str], pairs: Sequence[Coupling]) -> None:
        self._skeleton = skeleton
        self._rows = np.zeros((len(pairs), len(names)))
        for row, pair in zip(self._rows, pairs, strict=True):
            row[names.index(pair.follower)], row[names.index(pair.leader)] = 1.0, -pair.ratio
        self._offsets = np.array([pair.offset for pair in pairs])

    def push(self) -> None:
        """For the next step. Motors and contacts act later in it, so what they do to one joint the
        other one feels in the step after."""
        s, rows = self._skeleton, self._rows
        s.computeForwardDynamics()
        step, v = s.getTimeStep(), s.getVelocities()
        coming = s.getPositions() + step * (v + step * s.getAccelerations())
        gap = (rows @ coming - self._offsets) / step
        felt = np.linalg.solve(s.getAugMassMatrix(), rows.T)  # with springs and dampers
        impulse = np.linalg.solve(rows @ felt, -gap)
        s.setVelocities(v + np.linalg.solve(s.getMassMatrix(), rows.T @ impulse))
