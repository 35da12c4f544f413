"""What PhysX says that it built, by the names of `simulator.quantities`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pytest_simbench.scene import Box, ConvexMesh, FloatArray, Pose, Scene
from pytest_simbench.simulator import PreparedRobot, one_value
from pytest_simbench.simulator.links import link_poses
from pytest_simbench.simulator.shapes import box_corners, outlines, reach

from . import stage as usd
from .session import Session
from .usd_text import turn_from_x

_FRICTIONS = ("staticFriction", "dynamicFriction")
_ATTRIBUTES = (
    "position",
    "orientation",
    "mass",
    "inverseMass",
    "inertia",
    "centerOfMassPosition",
    "disableGravity",
    "disableSimulation",
    "restitution",
    "restOffset",
    "shapeCount",
    "linearVelocity",
    "angularVelocity",
    *_FRICTIONS,
)
_Values = Mapping[str, Mapping[str, FloatArray]]


def read_back(
    session: Session,
    scene: Scene,
    prepared: PreparedRobot | None,
    units: FloatArray,
    places: Mapping[str, Pose],
) -> dict[str, Any]:
    """Every quantity that PhysX can tell.

    Args:
        session: to be asked.
        scene: the names of what was built; no value is taken from it.
        prepared: the names of the robot's joints and links.
        units: of the sessions' joint positions, (n_joints,) [rad or m].
        places: where the stage put the links, until the first step: PhysX's scene queries find
            them there. Empty from then on: the queries find them where they are.
    """
    reported: dict[str, Any] = {"ground/height": session.height(usd.GROUND)}
    values = session.read("RIGID_BODY", *_ATTRIBUTES)
    for index, box in enumerate(scene.bodies):
        path, prefix = usd.body_path(index), f"body/{box.name}"
        pose = _pose(values, path)
        shape = f"{path}/shape"
        if isinstance(box, Box):  # rays tell the size of a box more exactly
            outline = outlines(prefix, [reach(box_corners(session.size(shape, pose)))], [])
        else:
            swept = [session.reach(shape, pose, Pose())]
            mesh = isinstance(box, ConvexMesh)
            outline = outlines(prefix, [], swept if mesh else [], [] if mesh else swept)
        reported |= _part(values, path, prefix) | outline
        if box.mass:
            reported |= _inertial(values, path, prefix)
            velocity = [values[name][path] for name in ("linearVelocity", "angularVelocity")]
            reported[f"{prefix}/velocity"] = np.concatenate(velocity)
    if prepared is not None:
        reported |= _links(session, prepared, places)
        reported |= _joints(session, prepared, units)
    return reported


def _links(session: Session, prepared: PreparedRobot, places: Mapping[str, Pose]) -> dict[str, Any]:
    values = session.read("ARTICULATION_LINK", *_ATTRIBUTES)
    reported: dict[str, Any] = {}
    for index, (name, link) in enumerate(prepared.links.items()):
        path, prefix = usd.link_path(index), f"link/{name}"
        kinds: tuple[list[FloatArray], list[FloatArray]] = ([], [])
        place = places[name] if places else _pose(values, path)
        for k, shape in enumerate(link.shapes[: int(values["shapeCount"][path])]):
            found = session.reach(f"{path}/shape_{k}", place, shape.pose)
            kinds[shape.size is None].append(found)
        reported |= _part(values, path, prefix) | outlines(prefix, *kinds)
        if name != prepared.root:
            reported |= _inertial(values, path, prefix)
    return reported


def _part(values: _Values, path: str, prefix: str) -> dict[str, Any]:
    """Pose and surface of a body or link."""
    found: dict[str, Any] = {f"{prefix}/pose": _pose(values, path).as_array()}
    if values["shapeCount"][path]:
        frictions = [_each_shape(values, name, path) for name in _FRICTIONS]
        found[f"{prefix}/friction"] = one_value(frictions)
        found[f"{prefix}/restitution"] = one_value(_each_shape(values, "restitution", path))
        found[f"{prefix}/margin"] = one_value(_each_shape(values, "restOffset", path))
    return found


def _inertial(values: _Values, path: str, prefix: str) -> dict[str, Any]:
    moved = not (values["disableSimulation"][path] or values["disableGravity"][path])
    return {
        f"{prefix}/mass": values["mass"][path],
        f"{prefix}/com": values["centerOfMassPosition"][path],
        f"{prefix}/inertia": values["inertia"][path].reshape(3, 3),
        f"{prefix}/gravity": float(moved),
    }


def _joints(session: Session, prepared: PreparedRobot, units: FloatArray) -> dict[str, Any]:
    ones = np.ones_like(units)
    attributes = {
        "jointLimit": ("limits", units),
        "jointMaxForce": ("effort_limit", ones),
        "jointStiffness": ("stiffness", 1 / units),
        "jointDamping": ("damping", 1 / units),
        "jointArmature": ("armature", ones),
        "jointPosition": ("initial_position", units),
    }
    passive = ("jointStaticFriction", "jointDynamicFriction", "jointViscousFriction")
    values = session.read("ARTICULATION_JOINT", *attributes, *passive)
    axes = _axes(session, prepared)
    found: dict[str, Any] = {}
    for i, name in enumerate(prepared.robot.joint_names):
        path, prefix = usd.joint_path(i), f"joint/{name}"
        for attribute, (quantity, scale) in attributes.items():
            found[f"{prefix}/{quantity}"] = values[attribute][path][0] * scale[i]
        found[f"{prefix}/friction"] = sum(abs(values[kind][path][0]) for kind in passive)
        found[f"{prefix}/axis"] = axes[path]
    return found


def _axes(session: Session, prepared: PreparedRobot) -> dict[str, FloatArray]:
    """Motion subspace of each joint by its prim, from PhysX's Jacobian.

    Its rows are, for each moving link, velocity of the centre of mass and angular velocity in the
    world; a link is in the place of its own joint's column.
    """
    order = session.dof_joints()
    jacobian = session.read("ARTICULATION", "jacobian")["jacobian"][usd.ROOT]
    blocks = np.reshape(jacobian, (len(order), 6, len(order)))
    links = session.read("ARTICULATION_LINK", "position", "orientation", "centerOfMassPosition")
    names = list(prepared.links)
    child = {
        usd.joint_path(prepared.robot.joint_names.index(j.name)): names.index(j.child)
        for j in prepared.joints
    }
    axes = {}
    for k, joint in enumerate(order):
        path = usd.link_path(child[joint])
        turn = _pose(links, path).rotation().T
        speed, spin = turn @ blocks[k, :3, k], turn @ blocks[k, 3:, k]
        axes[joint] = np.concatenate(
            [spin, speed - np.cross(spin, links["centerOfMassPosition"][path])]
        )
    return axes


def _pose(values: _Values, path: str) -> Pose:
    x, y, z, w = values["orientation"][path]
    return Pose.from_array([*values["position"][path], w, x, y, z])


def _each_shape(values: _Values, attribute: str, path: str) -> FloatArray:
    """An attribute of all shapes of a prim."""
    count = int(values["shapeCount"][path])
    return np.atleast_1d(values[attribute][path])[:count]


def wrenches(told: FloatArray, prepared: PreparedRobot, positions: FloatArray) -> FloatArray:
    """Of the driven joints, on the links below about their origins, in the world, (n_joints, 6).

    Args:
        told: by PhysX of each link by its number in `prepared.links`, (n_links, 6), in the axes of
            the frame of the joint above it, whose x is the joint's axis.
        prepared: whose joints they are.
        positions: of the joints, (n_joints,).
    """
    names = prepared.robot.joint_names
    poses = link_poses(prepared, dict(zip(names, positions, strict=True)))
    numbers = {name: k for k, name in enumerate(prepared.links)}
    joints = {joint.name: joint for joint in prepared.joints}
    rows = []
    for joint in (joints[name] for name in names):
        axes = Pose(quaternion=turn_from_x(np.asarray(joint.axis)))
        turn = (poses[joint.child] * axes).rotation()
        rows.append((told[numbers[joint.child]].reshape(2, 3) @ turn.T).ravel())
    return np.array(rows).reshape(-1, 6)
