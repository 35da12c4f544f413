"""What PhysX says that it built, by the names of `parity.quantities`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pytest_simbench.description.links import link_poses
from pytest_simbench.description.shapes import (
    DIRECTIONS,
    OUTLINES,
    box_corners,
    order_of,
    outlines,
    reach,
)
from pytest_simbench.parity import readback
from pytest_simbench.parity.readback import one_value
from pytest_simbench.scene import Body, Box, ConvexMesh, FloatArray, Pose
from pytest_simbench.simulator import PreparedRobot

from . import stage as usd
from .session import Session
from .usd_text import turn_from_x

_FRICTIONS = ("staticFriction", "dynamicFriction")
_ATTRIBUTES = (
    "position", "orientation", "mass", "inverseMass", "inertia", "centerOfMassPosition",
    "disableGravity", "disableSimulation", "restitution", "restOffset", "shapeCount",
    "linearVelocity", "angularVelocity", *_FRICTIONS,
)  # fmt: skip
_JOINT = {
    "jointLimit": ("limits", 1),
    "jointMaxForce": ("effort_limit", 0),
    "jointStiffness": ("stiffness", -1),
    "jointDamping": ("damping", -1),
    "jointArmature": ("armature", 0),
    "jointPosition": ("initial_position", 1),
}
"""Of a joint: the quantity that an attribute is, and the power of the session's unit in it."""

_PASSIVE = ("jointStaticFriction", "jointDynamicFriction", "jointViscousFriction")
_Values = Mapping[str, Mapping[str, FloatArray]]


class ReadBack(readback.ReadBack):
    """Reads the quantities of `parity.quantities` that PhysX tells.

    Until the first step PhysX's scene queries find the links where the stage put them (`places`);
    from then on, where they are.
    """

    def __init__(self, simulator: Any) -> None:
        super().__init__(simulator)
        self.session, self.units = simulator.session, simulator._unit
        self.places = {} if simulator._steps else simulator._placed
        self.bodies = self.session.read("RIGID_BODY", *_ATTRIBUTES)
        if self.prepared is not None:
            self.links = self.session.read("ARTICULATION_LINK", *_ATTRIBUTES)
            self.joints = self.session.read("ARTICULATION_JOINT", *_JOINT, *_PASSIVE)
            self.axes = _axes(self.session, self.prepared)

    def world(self) -> dict[str, Any]:
        return {"ground/height": self.session.height(usd.GROUND)}

    def body(self, prefix: str, name: str) -> dict[str, Any]:
        box, values = self.scene.body(name), self.bodies
        path = usd.body_path(self.scene.bodies.index(box))
        pose = _pose(values, path)
        if isinstance(box, Box):  # rays tell the size of a box more exactly
            size = self.session.size(f"{path}/{usd.shape_name(0)}", pose)
            outline = outlines(prefix, [reach(box_corners(size))], [])
        else:
            outline = self._swept(prefix, box, path, pose, int(values["shapeCount"][path]))
        found = _part(values, path, prefix) | outline
        if box.mass:
            found |= _inertial(values, path, prefix)
            velocity = [values[name][path] for name in ("linearVelocity", "angularVelocity")]
            found[f"{prefix}/velocity"] = np.concatenate(velocity)
        return found

    def _swept(
        self, prefix: str, body: Body, path: str, pose: Pose, count: int
    ) -> dict[str, FloatArray]:
        """The outlines of the first shapes of a body. They are ordered as the scene's: an error of
        0.05 mm would order thin walls otherwise each time."""
        kinds: dict[str, list[tuple[FloatArray, FloatArray]]] = {name: [] for name in OUTLINES}
        of = {Box.kind: "boxes", ConvexMesh.kind: "meshes"}
        for k, part in enumerate(body.parts[:count]):
            swept = self.session.reach(f"{path}/{usd.shape_name(k)}", pose, part.pose)
            kinds[of.get(part.kind, "rounds")].append((swept, part.reach_placed(DIRECTIONS)))
        found = {}
        for kind, pairs in kinds.items():
            order = order_of([asked for _, asked in pairs])
            rows = np.array([pairs[k][0] for k in order])
            found[f"{prefix}/{kind}"] = rows.reshape(-1, len(DIRECTIONS))
        return found

    def link(self, prefix: str, name: str) -> dict[str, Any]:
        path, values = usd.link_path(list(self.prepared.links).index(name)), self.links
        kinds: tuple[list[FloatArray], list[FloatArray]] = ([], [])
        place = self.places[name] if self.places else _pose(values, path)
        shapes = self.prepared.links[name].shapes[: int(values["shapeCount"][path])]
        for k, shape in enumerate(shapes):
            found = self.session.reach(f"{path}/shape_{k}", place, shape.pose)
            kinds[shape.size is None].append(found)
        part = _part(values, path, prefix) | outlines(prefix, *kinds)
        return part if name == self.prepared.root else part | _inertial(values, path, prefix)

    def joint(self, prefix: str, name: str) -> dict[str, Any]:
        number, values = self.prepared.robot.joint_names.index(name), self.joints
        path, unit = usd.joint_path(number), self.units[number]
        found = {
            f"{prefix}/{quantity}": values[attribute][path][0] * unit**power
            for attribute, (quantity, power) in _JOINT.items()
        }
        found[f"{prefix}/friction"] = sum(abs(values[kind][path][0]) for kind in _PASSIVE)
        return found | {f"{prefix}/axis": self.axes[path]}

    def touches(self) -> dict[str, Any]:
        return {}


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
