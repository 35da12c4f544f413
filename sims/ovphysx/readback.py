"""What PhysX says that it built, by the names of `parity.quantities`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pytest_simbench.description.links import link_poses
from pytest_simbench.description.shapes import DIRECTIONS, Outline, a_box
from pytest_simbench.description.urdf import Link
from pytest_simbench.parity import readback
from pytest_simbench.parity.quantities import kind_of
from pytest_simbench.parity.readback import one_value
from pytest_simbench.scene import Body, Box, FloatArray, Pose
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


@dataclass(frozen=True)
class Part:
    """A body or link.

    Attributes:
        values: what PhysX tells of all prims of its kind, by attribute and prim.
        made: whose it is: the scene's, which says where its shapes are to be looked for.
    """

    path: str
    values: Mapping[str, Mapping[str, Any]]
    made: Body | Link

    def told(self, attribute: str) -> Any:
        return self.values[attribute][self.path]

    def of_shapes(self, attribute: str) -> FloatArray:
        """An attribute of all its shapes."""
        return np.atleast_1d(self.told(attribute))[: self.count]

    @property
    def count(self) -> int:
        """Of its shapes."""
        return int(self.told("shapeCount"))

    @property
    def pose(self) -> Pose:
        """In the world."""
        x, y, z, w = self.told("orientation")
        return Pose.from_array([*self.told("position"), w, x, y, z])


class ReadBack(readback.ReadBack):
    """Reads the quantities of `parity.quantities` that PhysX tells.

    Until the first step PhysX's scene queries find the links where the stage put them (`places`);
    from then on, where they are.
    """

    def __init__(self, simulator: Any) -> None:
        self.session, self.units = simulator.session, simulator._unit
        self.places = {} if simulator._steps else simulator._placed
        values = self.session.read("RIGID_BODY", *_ATTRIBUTES)
        bodies, links = enumerate(simulator.scene.bodies), {}
        if simulator.prepared is not None:
            links = _links(self.session, simulator.prepared)
            self.joints = self.session.read("ARTICULATION_JOINT", *_JOINT, *_PASSIVE)
            self.axes = _axes(self.session, simulator.prepared, links)
        super().__init__(
            simulator,
            None,
            {body.name: Part(usd.body_path(k), values, body) for k, body in bodies},
            links,
        )

    def world(self) -> dict[str, Any]:
        return {"ground/height": self.session.height(usd.GROUND)}

    def pose(self, part: Part) -> FloatArray:
        return part.pose.as_array()

    def shapes(self, part: Part) -> Iterator[Outline]:
        path, made, pose = part.path, part.made, part.pose
        if isinstance(made, Link):
            place = self.places.get(made.name, pose)
            for k, shape in enumerate(made.shapes[: part.count]):
                reached = self.session.reach(f"{path}/shape_{k}", place, shape.pose)
                yield "meshes" if shape.size is None else "boxes", reached
        elif isinstance(made, Box) and part.count:  # rays tell the size of a box more exactly
            size = self.session.size(f"{path}/{usd.shape_name(0)}", pose)
            yield a_box(size, Pose())
        else:
            for k, solid in enumerate(made.parts[: part.count]):
                name, size = f"{path}/{usd.shape_name(k)}", math.hypot(*solid.extents)
                yield kind_of(solid), self.session.reach(name, pose, solid.pose, size)

    def asked(self, part: Part) -> list[FloatArray] | None:
        """Of a body: an error of 0.05 mm would order thin walls otherwise each time."""
        if isinstance(part.made, Link):
            return None
        return [solid.reach_placed(DIRECTIONS) for solid in part.made.parts[: part.count]]

    def surface(self, part: Part | None) -> dict[str, Any]:
        """Nothing is told of the ground's."""
        if part is None:
            return {}
        return {
            "friction": one_value([part.of_shapes(name) for name in _FRICTIONS]),
            "restitution": one_value(part.of_shapes("restitution")),
            "margin": one_value(part.of_shapes("restOffset")),
        }

    def inertial(self, part: Part) -> dict[str, Any]:
        return {
            "mass": part.told("mass"),
            "com": part.told("centerOfMassPosition"),
            "inertia": part.told("inertia").reshape(3, 3),
            "gravity": float(not (part.told("disableSimulation") or part.told("disableGravity"))),
        }

    def body(self, part: Part, name: str) -> dict[str, Any]:
        if not self.scene.body(name).mass:
            return {}
        velocity = [part.told("linearVelocity"), part.told("angularVelocity")]
        return {"velocity": np.concatenate(velocity), **self.inertial(part)}

    def joint(self, name: str) -> dict[str, Any]:
        number, values = self.prepared.robot.joint_names.index(name), self.joints
        path, unit = usd.joint_path(number), self.units[number]
        found = {
            quantity: values[attribute][path][0] * unit**power
            for attribute, (quantity, power) in _JOINT.items()
        }
        static, dynamic, viscous = (float(values[kind][path][0]) for kind in _PASSIVE)
        found["friction"] = one_value([static, dynamic])
        found["damping"] += viscous / unit
        return found | {"axis": self.axes[name]}

    def touches(self) -> dict[str, Any]:
        return {}


def _links(session: Session, prepared: PreparedRobot) -> dict[str, Part]:
    values = session.read("ARTICULATION_LINK", *_ATTRIBUTES)
    links = enumerate(prepared.links.values())
    return {link.name: Part(usd.link_path(k), values, link) for k, link in links}


def _axes(
    session: Session, prepared: PreparedRobot, links: Mapping[str, Part]
) -> dict[str, FloatArray]:
    """Motion subspace of each joint by its name, from PhysX's Jacobian.

    Its rows are, for each moving link, velocity of the centre of mass and angular velocity in the
    world; a link is in the place of its own joint's column.
    """
    order = session.dof_joints()
    jacobian = session.read("ARTICULATION", "jacobian")["jacobian"][usd.ROOT]
    blocks = np.reshape(jacobian, (len(order), 6, len(order)))
    axes = {}
    for joint in prepared.joints:
        link = links[joint.child]
        k = order.index(usd.joint_path(prepared.robot.joint_names.index(joint.name)))
        turn = link.pose.rotation().T
        speed, spin = turn @ blocks[k, :3, k], turn @ blocks[k, 3:, k]
        centre = link.told("centerOfMassPosition")
        axes[joint.name] = np.concatenate([spin, speed - np.cross(spin, centre)])
    return axes


def wrenches(told: FloatArray, prepared: PreparedRobot, positions: FloatArray) -> FloatArray:
    """Of the driven joints, on the links below about their origins, in the world, (n_joints, 6).

    Args:
        told: by PhysX of each link by its number in `prepared.links`, (n_links, 6), in the axes of
            the frame of the joint above it, whose x is the joint's axis.
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
