"""The ground and the bodies of a scene in SAPIEN's world; what joints do there beside their drives,
each by itself, and two together."""

from __future__ import annotations

import math
from collections import defaultdict
from typing import Any

import numpy as np

from pytest_simbench.parity.readback import one_value
from pytest_simbench.scene import (
    Body,
    Box,
    Capsule,
    ConvexMesh,
    Coupling,
    Cylinder,
    FloatArray,
    Joint,
    Scene,
    Sphere,
)
from pytest_simbench.simulator import NotSupportedError, lazy_import

from .drawing import UPRIGHT, to_sapien

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
    builder.add_plane_collision(to_sapien(UPRIGHT), material)
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
    elif box.prescribed:
        entity = builder.build_kinematic(box.name)
    else:
        builder.set_mass_and_inertia(box.mass, sapien.Pose(), box.inertia())
        entity = builder.build(box.name)
    kind = physx.PhysxRigidStaticComponent if box.fixed else physx.PhysxRigidDynamicComponent
    body = entity.find_component_by_type(kind)
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


RUBBING = 1e6
"""Damping that holds a joint up to its friction [N m s/rad, N s/m]."""

BOUNDLESS = 3.4e38
"""An impulse that limits nothing [N m s, N s]: the largest of single precision."""


def add_own(joint: Any, own: Joint, timestep: float) -> list[Any]:
    """Constraints beside a joint: PhysX itself has friction as a coefficient of the load alone.

    Its spring is a soft limit of no range, which pulls in proportion to the angle; a drive of
    PhysX's constraints pulls in proportion to the sine of half of it.

    Raises:
        NotSupportedError: a hinge's spring is at rest half a turn away or more. PhysX counts none.
    """
    if own.spring and abs(own.rest) >= math.pi and not _slides(joint):
        raise NotSupportedError(
            f"sapien has springs of hinges within half a turn alone: {own.name!r} is at rest at "
            f"{own.rest:g} rad"
        )
    made = []
    if own.spring or own.passive_damping:
        made.append(_beside(joint, own.passive_damping, BOUNDLESS))
    if own.spring:
        limit = made[0].set_limit_x if _slides(joint) else made[0].set_limit_twist
        limit(own.rest, own.rest, own.spring, 0.0)
    if own.friction:
        made.append(_beside(joint, RUBBING, own.friction * timestep))
    return made


def _beside(joint: Any, damping: float, impulse: float) -> Any:
    """A constraint that damps a joint, by so much impulse in a step at most."""
    made = physx.PhysxDriveComponent(joint.child_link)
    made.parent = joint.parent_link
    made.pose_in_parent, made.pose_in_child = joint.pose_in_parent, joint.pose_in_child
    drive = made.set_drive_property_x if _slides(joint) else made.set_drive_property_twist
    drive(0.0, damping, impulse)
    joint.child_link.entity.add_component(made)
    return made


def own_of(joint: Any, made: list[Any], timestep: float) -> tuple[float, float, float, Any]:
    """Stiffness, damping and friction of a joint by such constraints, and where its spring is at
    rest; None: it has none."""
    stiffness = damping = friction = 0.0
    rest = None
    for beside in made:
        limit, drive = (
            (beside.get_limit_x(), beside.get_drive_property_x())
            if _slides(joint)
            else (beside.get_limit_twist(), beside.get_drive_property_twist())
        )
        if limit[2]:
            stiffness, rest = stiffness + limit[2], one_value(limit[:2])
        if drive[2] < BOUNDLESS / 2:
            friction += drive[2] / timestep
        else:
            damping += drive[1]
    return stiffness, damping, friction, rest


def _slides(joint: Any) -> bool:
    return "prism" in joint.type


def couple(robot: Any, pair: Coupling, stiffness: float) -> None:
    """Move two joints together, by a tendon from the link that both hang on.

    Torques of a tendon go by the coefficients too. SAPIEN's own loader has them go by their
    inverse, right at a ratio of 1 alone.

    Raises:
        NotSupportedError: they hang on two links. All torques of a tendon push back on one.
    """
    leader, follower = (robot.find_joint_by_name(name) for name in (pair.leader, pair.follower))
    link = leader.parent_link
    if follower.parent_link is not link:
        raise NotSupportedError(
            f"sapien couples joints of one link alone: {pair.leader!r} is on {link.name!r}, "
            f"{pair.follower!r} on {follower.parent_link.name!r}"
        )
    scale, pulls = _pulls(pair)
    links, shares = [link, leader.child_link, follower.child_link], [0.0, *pulls]
    rest = pair.offset / scale
    robot.create_fixed_tendon(links, shares, shares, rest_length=rest, stiffness=stiffness)


def _pulls(pair: Coupling) -> tuple[float, FloatArray]:
    """What a tendon's length is divided by, and its coefficients of leader and follower."""
    scale = max(1.0, abs(pair.ratio))  # with larger coefficients joints stick, 0.2 rad apart
    return scale, np.array([-pair.ratio, 1.0]) / scale


SUBSTEP = 4e-5
"""Of a robot with couplings beside its gripper's, at most [s]; PhysX has no more than 255 in a
step. It solves the joints of a tendon by turns: from rest, the first takes more than its share of
the torque, the more the stiffer the tendon is in a sub-step."""

SOFT = 2e-3
"""What a tendon there closes of its gap in a sub-step, at most."""


def soften(robot: Any, pair: Coupling, timestep: float) -> float:
    """Have the robot solved in such sub-steps; the stiffness of the tendon of a pair."""
    count = max(robot.solver_position_iterations, min(255, math.ceil(timestep / SUBSTEP)))
    robot.set_solver_position_iterations(count)
    inertia = robot.create_pinocchio_model().compute_generalized_mass_matrix(robot.qpos)
    order = [joint.name for joint in robot.active_joints]
    pulls = np.zeros(len(order))
    pulls[[order.index(pair.leader), order.index(pair.follower)]] = _pulls(pair)[1]
    return float(SOFT * (count / timestep) ** 2 / (pulls @ np.linalg.solve(inertia, pulls)))
