"""What PhysX says through SAPIEN that it built, for the parity check."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from pytest_simbench.description.links import subspace
from pytest_simbench.description.shapes import NO_REACH, Outline, a_box, a_cylinder, a_mesh, a_round
from pytest_simbench.parity import readback
from pytest_simbench.parity.readback import one_value
from pytest_simbench.scene import FloatArray, Pose
from pytest_simbench.simulator import lazy_import

from .bodies import own_of
from .drawing import UPRIGHT

physx = lazy_import("sapien.physx")

LYING = UPRIGHT.inverse()
"""Turns the z axis to the x axis, along which SAPIEN's cylinders and capsules lie."""


class ReadBack(readback.ReadBack):
    """Reads the quantities of `parity.quantities` that SAPIEN tells."""

    def __init__(self, simulator: Any) -> None:
        super().__init__(simulator, simulator._ground, simulator._bodies, simulator._links)
        self.system, self.made = simulator._system, simulator._closures
        names = () if self.prepared is None else self.prepared.robot.joint_names
        positions = simulator.joint_state()[0]
        states = zip(simulator._joints, simulator._own, positions, strict=True)
        self.joints = dict(zip(names, states, strict=True))

    def world(self) -> dict[str, Any]:
        plane = self.ground.entity.pose * self.ground.collision_shapes[0].local_pose
        return {
            "gravity": self.system.config.gravity,
            "timestep": self.system.timestep,
            "ground/height": plane.p[2],
        }

    def pose(self, part: Any) -> FloatArray:
        return np.concatenate([part.entity.pose.p, part.entity.pose.q])

    def shapes(self, part: Any) -> Iterator[Outline]:
        for shape in part.collision_shapes:
            pose = _pose(shape.local_pose)
            if isinstance(shape, physx.PhysxCollisionShapeBox):
                yield a_box(2 * shape.half_size, pose)
            elif isinstance(shape, physx.PhysxCollisionShapeConvexMesh):
                corners = np.asarray(shape.vertices, dtype=float) * shape.scale
                yield a_mesh(corners, pose)
            elif hasattr(shape, "radius"):
                length = 2 * getattr(shape, "half_length", 0.0)
                pillar = isinstance(shape, physx.PhysxCollisionShapeCylinder)
                yield (a_cylinder if pillar else a_round)(shape.radius, length, pose * LYING)
            else:
                yield "meshes", NO_REACH

    def surface(self, part: Any) -> dict[str, Any]:
        """Static and dynamic friction are one number where they agree."""
        shapes = part.collision_shapes
        stuff = [shape.physical_material for shape in shapes]
        return {
            "friction": one_value([[m.static_friction, m.dynamic_friction] for m in stuff]),
            "restitution": one_value([m.restitution for m in stuff]),
            "margin": one_value([shape.rest_offset for shape in shapes]),
        }

    def inertial(self, part: Any) -> dict[str, Any]:
        centre = _pose(part.cmass_local_pose)
        axes = centre.rotation()
        return {
            "mass": part.mass,
            "com": centre.position,
            "inertia": axes @ np.diag(part.inertia) @ axes.T,
            "damping": [part.linear_damping, part.angular_damping],
            "gravity": float(not part.disable_gravity),
        }

    def body(self, part: Any, name: str) -> dict[str, Any]:
        if isinstance(part, physx.PhysxRigidStaticComponent) or part.kinematic:
            return {"dynamic": 0.0}
        velocity = np.concatenate([part.linear_velocity, part.angular_velocity])
        free = float(not any(part.locked_motion_axes))
        return {"dynamic": free, "velocity": velocity, **self.inertial(part)}

    def joint(self, name: str) -> dict[str, Any]:
        joint, own, position = self.joints[name]
        stiffness, damping, friction, rest = own_of(joint, own, self.system.timestep)
        frame = _pose(joint.pose_in_child)  # which turns about, or moves along, its x axis
        axis, at = frame.rotation()[:, 0], np.asarray(frame.position)
        return ({} if rest is None else {"rest": rest}) | {
            "axis": subspace(axis, at, slides="prism" in joint.type),
            "limits": joint.limits[0],
            "effort_limit": joint.force_limit,
            "stiffness": joint.stiffness + stiffness,
            "damping": joint.damping + damping,
            "friction": joint.friction + friction,
            "armature": joint.armature[0],
            "initial_position": position,
        }

    def closures(self) -> list[tuple[FloatArray, bool]]:
        points = [np.array([made.pose_in_parent.p, made.pose_in_child.p]) for made in self.made]
        welds = [made.get_drive_property_slerp()[0] > 0 for made in self.made]
        return list(zip(points, welds, strict=True))

    def collide(self, first: Any, second: Any) -> Any:
        """By PhysX's filter as SAPIEN sets it; two links that one joint joins never do."""
        links = first in self.links.values() and second in self.links.values()
        if links and (first.parent is second or second.parent is first):
            return ()
        return [
            [_compatible(x.collision_groups, y.collision_groups) for y in second.collision_shapes]
            for x in first.collision_shapes
        ]


def _compatible(a: Sequence[int], b: Sequence[int]) -> bool:
    """SAPIEN's filter shader: groups of 0, 1 name classes, of 2 exceptions. Class of one in the
    mask of the other, no shared exception."""
    excepted = a[2] & b[2] and (a[3] & 0xFFFF) == (b[3] & 0xFFFF)
    return bool((a[0] & b[1]) or (a[1] & b[0])) and not excepted


def _pose(pose: Any) -> Pose:
    return Pose.from_array([*pose.p, *pose.q])
