"""The scene as bodies, geoms and joints of ODE.

The origin of a body of ODE is its centre of mass; its axes are those of the link. A hinge tells
angles from -180 to 180 degrees: its zero is put into the middle of the joint's range, since one
joint of a Panda turns to 215. Joints that turn by 360 degrees and more are counted on.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pytest_simbench.description.links import ends, link_poses, motion_subspace
from pytest_simbench.description.mesh_check import read_stl
from pytest_simbench.description.urdf import Link, MovingJoint, Shape
from pytest_simbench.scene import (
    Body,
    Box,
    Capsule,
    Closure,
    Compound,
    ConvexMesh,
    Cylinder,
    FloatArray,
    Pose,
    Sphere,
)
from pytest_simbench.simulator import NotSupportedError, PreparedRobot, lazy_import

from .axes import Axis
from .contacts import BASE, FIXED, FREE, GROUND, LINK, LINKS, Part, Surface
from .library import HI_STOP, LO_STOP, Convex, Mesh, place, set_damping

ode = lazy_import("ode")


def add_ground(space: Any, friction: float, restitution: float) -> Part:
    """The plane z = 0."""
    ground = Part(Surface(None, friction, restitution))
    ground.add(ode.GeomPlane(space, (0.0, 0.0, 1.0), 0.0), GROUND)
    return ground


def add_body(world: Any, space: Any, box: Body, timestep: float) -> Part:
    """A body, fixed or free, in a world with this time step [s]."""
    part = Part(Surface(None, box.friction, box.restitution))
    for shape in box.parts:
        part.add(_solid(space, shape), FREE if box.mass else FIXED)
    if box.fixed:
        for geom, shape in zip(part.geoms, box.parts, strict=True):
            place(geom, box.pose * shape.pose)
        return part
    weight = (1.0, np.eye(3)) if box.prescribed else (box.mass, np.diag(box.inertia()))
    part.surface.body = _body(world, *weight, box.pose)
    if box.prescribed:
        part.body.setKinematic()
    set_damping(part.body, box.damping * timestep)
    part.body.setLinearVel(box.linear_velocity)
    part.body.setAngularVel(box.angular_velocity)
    for geom, shape in zip(part.geoms, box.parts, strict=True):
        if isinstance(box, Compound):
            place(geom, shape.pose, part.body)
        else:
            geom.setBody(part.body)
    return part


def _solid(space: Any, body: Body) -> Any:
    """The geom of a body; those of ODE are along z."""
    match body:
        case Box():
            return ode.GeomBox(space, body.size)
        case Sphere():
            return ode.GeomSphere(space, body.radius)
        case Cylinder():
            return ode.GeomCylinder(space, body.radius, body.length)
        case Capsule():
            return ode.GeomCapsule(space, body.radius, body.length)
        case ConvexMesh():
            return Convex(space, body.hull)
    raise NotSupportedError(f"ode has no {type(body).__name__}")


def add_links(world: Any, space: Any, prepared: PreparedRobot) -> dict[str, Part]:
    """The robot's links by name, in the middle of every joint's range."""
    poses = link_poses(prepared, middle(prepared))
    return {
        name: _add_link(world, space, link, poses[name], prepared)
        for name, link in prepared.links.items()
    }


def _add_link(world: Any, space: Any, link: Link, pose: Pose, prepared: PreparedRobot) -> Part:
    fixed = link.name == prepared.root
    x, y, z = (0.0, 0.0, 0.0) if fixed else (float(value) for value in link.centre)
    frame = Pose.at(-x, -y, -z)  # in the body's
    part = Part(Surface(None, prepared.robot.friction), frame)
    if not fixed:
        part.surface.body = _body(world, link.mass, link.inertia, pose * frame.inverse())
    for shape in link.shapes:
        geom = _geom(space, shape)
        place(geom, (pose if fixed else frame) * shape.pose, part.body)
        part.add(geom, BASE if fixed else LINK, LINKS if prepared.robot.self_collide else 0)
    return part


SLACK = 0.2
"""A range so much smaller than a turn is wide too: at a stop a joint gives way a little [rad]."""


def add_joints(
    world: Any, prepared: PreparedRobot, links: Mapping[str, Part], timestep: float
) -> dict[str, Axis]:
    """The joints by name; the links stand in the middle of every joint's range."""
    places, zeros = link_poses(prepared, middle(prepared)), middle(prepared)
    axes = {}
    for joint in prepared.joints:
        lower, upper = prepared.limits[joint.name] - zeros[joint.name]
        axis = Axis(
            _joint(world, joint, links, places[joint.child]),
            zeros[joint.name],
            timestep,
            wide=joint.kind == "revolute" and upper - lower > math.tau - SLACK,
        )
        axis.limit(world, lower, upper)
        axes[joint.name] = axis
    return axes


def _joint(world: Any, joint: MovingJoint, links: Mapping[str, Part], pose: Pose) -> Any:
    hinged = joint.kind == "revolute"
    made = ode.HingeJoint(world) if hinged else ode.SliderJoint(world)
    made.attach(links[joint.child].body, links[joint.parent].body)
    direction = pose.rotation() @ (motion_subspace(joint)[:3] + motion_subspace(joint)[3:])
    if hinged:
        made.setAnchor(pose.position)
    made.setAxis(tuple(direction))
    return made


def put_links(
    prepared: PreparedRobot, links: Mapping[str, Part], positions: Mapping[str, float]
) -> None:
    """Put the links where they stand at joint positions [rad or m]."""
    poses = link_poses(prepared, positions)
    for joint in prepared.joints:
        part = links[joint.child]
        _put(part.body, poses[joint.child] * part.frame.inverse())


def close_loop(
    world: Any, prepared: PreparedRobot, links: Mapping[str, Part], closure: Closure
) -> Any:
    """Hold two links together by a ball joint, or weld them; they stand at the joints' initial
    positions. A weld is a hinge that is stopped on both sides: ODE's fixed joint tells no point."""
    first, second = ends(prepared, closure)
    made = ode.HingeJoint(world) if closure.rigid else ode.BallJoint(world)
    made.attach(links[closure.first].body, links[closure.second].body)
    made.setAnchor(tuple((first + second) / 2))
    if closure.rigid:
        made.setAxis((0.0, 0.0, 1.0))
        made.setParam(LO_STOP, 0.0)
        made.setParam(HI_STOP, 0.0)
    return made


def middle(prepared: PreparedRobot) -> dict[str, float]:
    """The middle of every joint's range [rad or m]."""
    return {name: float(np.mean(limits)) for name, limits in prepared.limits.items()}


def _body(world: Any, mass: float, inertia: FloatArray, pose: Pose) -> Any:
    """A body; inertia about its origin, in its axes."""
    weight = ode.Mass()
    i = inertia
    weight.setParameters(mass, 0, 0, 0, i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2])
    body = ode.Body(world)
    body.setMass(weight)
    _put(body, pose)
    return body


def _put(body: Any, pose: Pose) -> None:
    body.setPosition(pose.position)
    body.setQuaternion(pose.quaternion)


def _geom(space: Any, shape: Shape) -> Any:
    if shape.size is not None:
        return ode.GeomBox(space, shape.size)
    return Mesh(space, read_stl(Path(shape.mesh or "").read_bytes()))
