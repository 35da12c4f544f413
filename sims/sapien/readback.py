"""What PhysX says through SAPIEN that it built, for the parity check."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from pytest_simbench.description.shapes import (
    box_corners,
    cylinder_reach,
    outlines,
    placed,
    reach,
    round_reach,
)
from pytest_simbench.parity import readback
from pytest_simbench.parity.readback import one_value
from pytest_simbench.scene import FloatArray, Pose
from pytest_simbench.simulator import lazy_import

physx = lazy_import("sapien.physx")

LYING = Pose(quaternion=(math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0))
"""Turns the z axis to the x axis, along which SAPIEN's cylinders and capsules lie."""


class ReadBack(readback.ReadBack):
    """Reads the quantities of `parity.quantities` that SAPIEN tells."""

    def __init__(self, simulator: Any) -> None:
        super().__init__(simulator)
        self.system, self.ground = simulator._system, simulator._ground
        self.bodies, self.links = simulator._bodies, simulator._links
        self.made = simulator._closures
        names = () if self.prepared is None else self.prepared.robot.joint_names
        states = zip(simulator._joints, simulator.joint_state()[0], strict=True)
        self.joints = dict(zip(names, states, strict=True))

    def world(self) -> dict[str, Any]:
        plane = self.ground.entity.pose * self.ground.collision_shapes[0].local_pose
        return {
            "gravity": self.system.config.gravity,
            "timestep": self.system.timestep,
            "ground/height": plane.p[2],
            "ground/friction": _friction(self.ground),
            "ground/restitution": _restitution(self.ground),
        }

    def body(self, prefix: str, name: str) -> dict[str, Any]:
        body = self.bodies[name]
        found = _part(prefix, body)
        static = isinstance(body, physx.PhysxRigidStaticComponent)
        found[f"{prefix}/dynamic"] = float(not static and _free(body))
        if not (static or body.kinematic):
            found |= _inertial(prefix, body)
            velocity = np.concatenate([body.linear_velocity, body.angular_velocity])
            found[f"{prefix}/velocity"] = velocity
        return found

    def link(self, prefix: str, name: str) -> dict[str, Any]:
        link = self.links[name]
        return _part(prefix, link) | (_inertial(prefix, link) if link.parent is not None else {})

    def joint(self, prefix: str, name: str) -> dict[str, Any]:
        return _joint(prefix, *self.joints[name])

    def closures(self) -> list[FloatArray]:
        return [np.array([made.pose_in_parent.p, made.pose_in_child.p]) for made in self.made]

    def can_touch(self, a: str, b: str) -> bool:
        """By PhysX's filter as SAPIEN sets it: groups of 0, 1 name classes, of 2 exceptions."""
        links = a.startswith("link/") and b.startswith("link/")
        if links and self._joined(a, b):
            return False
        found = [_compatible(x, y) for x in self._groups(a) for y in self._groups(b)]
        return any(found) if links else bool(found) and all(found)

    def _joined(self, a: str, b: str) -> bool:
        """Whether one joint joins two links, which PhysX then lets pass through each other."""
        first, second = (self.links[name.partition("/")[2]] for name in (a, b))
        return first.parent is second or second.parent is first

    def _groups(self, name: str) -> list[Sequence[int]]:
        kind, _, rest = name.partition("/")
        component = {"ground": self.ground}.get(kind) or (
            self.bodies[rest] if kind == "body" else self.links[rest]
        )
        return [shape.collision_groups for shape in component.collision_shapes]


def _compatible(a: Sequence[int], b: Sequence[int]) -> bool:
    """SAPIEN's filter shader: class of one in the mask of the other, no shared exception."""
    excepted = a[2] & b[2] and (a[3] & 0xFFFF) == (b[3] & 0xFFFF)
    return bool((a[0] & b[1]) or (a[1] & b[0])) and not excepted


def _part(prefix: str, component: Any) -> dict[str, Any]:
    """Pose, shapes and surface of a body or link."""
    shapes = component.collision_shapes
    pose = component.entity.pose
    found = {f"{prefix}/pose": np.concatenate([pose.p, pose.q])}
    boxes = [s for s in shapes if isinstance(s, physx.PhysxCollisionShapeBox)]
    rounds = [s for s in shapes if hasattr(s, "radius")]
    meshes = [s for s in shapes if s not in boxes and s not in rounds]
    found |= outlines(prefix, *(map(_reach, kind) for kind in (boxes, meshes, rounds)))
    if shapes:
        found[f"{prefix}/friction"] = _friction(component)
        found[f"{prefix}/restitution"] = _restitution(component)
        found[f"{prefix}/margin"] = one_value([shape.rest_offset for shape in shapes])
    return found


def _reach(shape: Any) -> FloatArray:
    """The reach of a shape in the frame of its body."""
    if hasattr(shape, "radius"):
        lying = _pose(shape.local_pose) * LYING
        length = 2 * getattr(shape, "half_length", 0.0)
        pillar = isinstance(shape, physx.PhysxCollisionShapeCylinder)
        return (cylinder_reach if pillar else round_reach)(shape.radius, length, lying)
    if isinstance(shape, physx.PhysxCollisionShapeBox):
        corners = box_corners(2 * shape.half_size)
    elif isinstance(shape, physx.PhysxCollisionShapeConvexMesh):
        corners = np.asarray(shape.vertices, dtype=float) * shape.scale
    else:
        corners = np.full((1, 3), np.nan)  # no scene has such a shape
    return reach(placed(corners, _pose(shape.local_pose)))


def _inertial(prefix: str, body: Any) -> dict[str, Any]:
    centre = _pose(body.cmass_local_pose)
    axes = centre.rotation()
    return {
        f"{prefix}/mass": body.mass,
        f"{prefix}/com": centre.position,
        f"{prefix}/inertia": axes @ np.diag(body.inertia) @ axes.T,
        f"{prefix}/damping": [body.linear_damping, body.angular_damping],
        f"{prefix}/gravity": float(not body.disable_gravity),
    }


def _free(body: Any) -> bool:
    return not body.kinematic and not any(body.locked_motion_axes)


def _joint(prefix: str, joint: Any, position: float) -> dict[str, Any]:
    frame = _pose(joint.pose_in_child)  # which turns about, or moves along, its x axis
    axis, still = frame.rotation()[:, 0], np.zeros(3)
    turning = [axis, np.cross(frame.position, axis)]
    return {
        f"{prefix}/axis": np.concatenate([still, axis] if "prism" in joint.type else turning),
        f"{prefix}/limits": joint.limits[0],
        f"{prefix}/effort_limit": joint.force_limit,
        f"{prefix}/stiffness": joint.stiffness,
        f"{prefix}/damping": joint.damping,
        f"{prefix}/friction": joint.friction,
        f"{prefix}/armature": joint.armature[0],
        f"{prefix}/initial_position": position,
    }


def _pose(pose: Any) -> Pose:
    return Pose.from_array([*pose.p, *pose.q])


def _materials(component: Any) -> Iterable[Any]:
    return (shape.physical_material for shape in component.collision_shapes)


def _friction(component: Any) -> Any:
    """The friction of all shapes of a body, static and dynamic; one number when they agree."""
    return one_value([[m.static_friction, m.dynamic_friction] for m in _materials(component)])


def _restitution(component: Any) -> Any:
    return one_value([m.restitution for m in _materials(component)])
