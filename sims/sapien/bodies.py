"""The ground and the bodies of a scene in SAPIEN's world."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import numpy as np

from pytest_simbench.scene import Body, Box, Capsule, ConvexMesh, Cylinder, Scene, Sphere
from pytest_simbench.simulator import NotSupportedError, lazy_import

from .drawing import UPRIGHT, facing_up, to_sapien

sapien = lazy_import("sapien")
physx = lazy_import("sapien.physx")

ROBOT, WORLD = 1, 2
"""Collision groups: the robot's links touch everything but each other."""

CLASSES = 30
"""Of what is kept apart: SAPIEN has 32 bits of groups."""

Groups = dict[str, list[int]]
"""SAPIEN's four words of groups by "ground", `body/NAME` and `link/NAME`."""


def groups_apart(scene: Scene) -> Groups:
    """Groups of what the scene keeps apart: bodies, or links, with the same partners are a class.

    Raises:
        NotSupportedError: there are more classes than bits.
    """
    partners: dict[str, set[str]] = defaultdict(set)
    for first, second in scene.apart:
        partners[first].add(second)
        partners[second].add(first)
    classes = {name: (name[:5] == "link/", frozenset(of)) for name, of in partners.items()}
    bits = {made: 4 << k for k, made in enumerate(dict.fromkeys(classes.values()))}
    if len(bits) > CLASSES:
        raise NotSupportedError(f"sapien keeps {CLASSES} kinds of parts apart, not {len(bits)}")
    through = scene.robot is not None and not scene.robot.self_collide
    found = {}
    for name, (link, others) in classes.items():
        mask = WORLD if link and through else WORLD | ROBOT
        for other, made in classes.items():
            if other not in others and not (link and made[0] and through):
                mask |= bits[made]
        found[name] = [bits[classes[name]], mask, 0, 0]
    return found


def add_ground(world: Any, scene: Scene, groups: Groups) -> Any:
    """The component of the plane z = 0, made in the world."""
    builder = world.create_actor_builder()
    friction = scene.ground_friction
    material = physx.PhysxMaterial(friction, friction, scene.ground_restitution)
    builder.add_plane_collision(facing_up(), material)
    builder.collision_groups = groups.get("ground", [WORLD, WORLD | ROBOT, 0, 0])
    entity = builder.build_static("ground")
    return entity.find_component_by_type(physx.PhysxRigidStaticComponent)


def add_body(world: Any, box: Body, angular_damping: float, groups: Groups) -> Any:
    """The component of a body, made in the world; `angular_damping` [1/s] where it has none."""
    builder = world.create_actor_builder()
    material = physx.PhysxMaterial(box.friction, box.friction, box.restitution)
    for part in box.parts:
        _add_shape(builder, part, material)
    builder.collision_groups = groups.get(f"body/{box.name}", [WORLD, WORLD | ROBOT, 0, 0])
    builder.initial_pose = sapien.Pose(box.pose.position, box.pose.quaternion)
    if box.fixed:
        entity = builder.build_static(box.name)
        body = entity.find_component_by_type(physx.PhysxRigidStaticComponent)
    elif box.prescribed:
        entity = builder.build_kinematic(box.name)
        body = entity.find_component_by_type(physx.PhysxRigidDynamicComponent)
    else:
        builder.set_mass_and_inertia(box.mass, sapien.Pose(), box.inertia())
        entity = builder.build(box.name)
        body = entity.find_component_by_type(physx.PhysxRigidDynamicComponent)
    for part in box.parts:
        if isinstance(part, ConvexMesh):
            body.attach(_mesh(part, material, builder.collision_groups))
    if not box.mass:
        return body
    body.angular_damping = angular_damping
    if box.damping.any():
        body.linear_damping, body.angular_damping = box.damping
    body.linear_velocity, body.angular_velocity = box.linear_velocity, box.angular_velocity
    return body


def _add_shape(builder: Any, body: Body, material: Any) -> None:
    """A collision shape of a body. Cylinders and capsules of SAPIEN lie along x."""
    place, upright = to_sapien(body.pose), to_sapien(body.pose * UPRIGHT)
    match body:
        case Box():
            half = [edge / 2 for edge in body.size]
            builder.add_box_collision(place, half, material)
        case Sphere():
            builder.add_sphere_collision(place, body.radius, material)
        case Cylinder():
            builder.add_cylinder_collision(upright, body.radius, body.length / 2, material)
        case Capsule():
            builder.add_capsule_collision(upright, body.radius, body.length / 2, material)


def _mesh(body: ConvexMesh, material: Any, groups: list[int]) -> Any:
    """The shape of a mesh, which SAPIEN's builder takes from a file alone."""
    corners = np.array(body.vertices, dtype=np.float32)
    shape = physx.PhysxCollisionShapeConvexMesh(corners, np.ones(3, dtype=np.float32), material)
    shape.set_collision_groups(groups)
    shape.local_pose = to_sapien(body.pose)
    return shape
