"""What Gazebo says that it built, for the parity check.

Poses, masses, inertias, gravity and the step come from the running world's components. Shapes,
surfaces and joints are told by none of them: they are read from the SDF that the server writes of
its world. The physics engine below the server tells nobody what it has.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any
from urllib.parse import unquote, urlparse

import numpy as np

from pytest_simbench.description.links import subspace
from pytest_simbench.description.shapes import (
    Outline,
    a_box,
    a_cylinder,
    a_mesh,
    a_round,
    mesh_corners,
)
from pytest_simbench.description.urdf import pose_of_rpy
from pytest_simbench.parity import readback
from pytest_simbench.parity.readback import one_value
from pytest_simbench.scene import Coupling, FloatArray, Pose

from .sdf import robot_model
from .server import bindings

EVERYTHING = 0xFFFF
"""SDF's default of `collide_bitmask`."""


@dataclass(frozen=True)
class Part:
    """The ground, a body or a link.

    Attributes:
        model: that it is a part of, of the bindings.
        link: the entity, of the bindings.
    """

    model: Any
    link: Any
    element: ET.Element


class ReadBack(readback.ReadBack):
    """Reads the quantities of `parity.quantities` that Gazebo tells."""

    def __init__(self, simulator: Any) -> None:
        self.server, self.physics = simulator.server, simulator._physics
        self.drives, self._robot = simulator._drives, robot_model(simulator.scene)
        models = self.server.sdf().findall("model")
        self._models = {model.get("name", ""): model for model in models}
        links = () if simulator.prepared is None else simulator.prepared.links
        super().__init__(
            simulator,
            self._find("ground", "link"),
            {body.name: self._find(body.name, "link") for body in simulator.scene.bodies},
            {name: self._find(self._robot, name) for name in links},
        )

    def _find(self, model: str, link: str) -> Part:
        elements = {e.get("name"): e for e in self._models[model].findall("link")}
        sim, ecm = bindings().sim, self.server.ecm
        made = sim.Model(self.server.world.model_by_name(ecm, model))
        return Part(made, sim.Link(made.link_by_name(ecm, link)), elements[link])

    def world(self) -> dict[str, Any]:
        normal, at = self._plane()
        return {
            "gravity": vector(self.server.world.gravity(self.server.ecm)),
            "timestep": self.server.timestep,
            "ground/height": at @ normal / normal[2],
        }

    def body(self, part: Part, name: str) -> dict[str, Any]:
        free = not part.model.static(self.server.ecm)
        moved = self.inertial(part) if free else {}
        return {"dynamic": float(free and not truth(part.element, "kinematic", False)), **moved}

    def pose(self, part: Part) -> FloatArray:
        return pose(part.link.world_pose(self.server.ecm)).as_array()

    def shapes(self, part: Part) -> Iterator[Outline]:
        for collision in part.element.findall("collision"):
            solid = collision.find("geometry/*")
            assert solid is not None
            yield _outline(solid, pose_in(collision))

    def inertial(self, part: Part) -> dict[str, Any]:
        frame = pose(part.link.world_pose(self.server.ecm))
        found, turn = part.link.world_inertial(self.server.ecm), frame.rotation()
        return {
            "mass": found.mass_matrix().mass(),
            "com": (frame.inverse() * pose(found.pose())).position,
            "inertia": turn.T @ matrix(found.moi()) @ turn,
            "gravity": float(truth(part.element, "gravity", True)),
        }

    def surface(self, part: Part) -> dict[str, Any]:
        """Friction and restitution of a link's shapes, in a pair with others like it; of a lone
        body and the ground, of that pair."""
        pairs = [(value, value) for value in self._frictions(part)]
        if self.physics.lone:
            (other,) = self.bodies.values()
            pairs = list(product(self._frictions(self.ground), self._frictions(other)))
        bounces = [
            number(collision, "surface/bounce/restitution_coefficient", 0.0) ** 2
            for collision in part.element.findall("collision")
        ]
        friction = [self.physics.friction_of(*pair) for pair in pairs]
        return {"friction": one_value(friction), "restitution": one_value(bounces)}

    def _frictions(self, part: Part) -> list[float]:
        """What a link's shapes have as friction."""
        return [
            number(collision, f"surface/friction/{name}", 1.0)
            for collision in part.element.findall("collision")
            for name in self.physics.friction_names
        ]

    def joint(self, name: str) -> dict[str, Any]:
        index = self.prepared.robot.joint_names.index(name)
        joint, zero = self._joint(name), float(self.drives.zeros[index])
        axis = joint.find("axis")
        assert axis is not None
        limits = [
            number(axis, "limit/lower", -math.inf) + zero,
            number(axis, "limit/upper", math.inf) + zero,
        ]
        passive = [
            number(axis, f"dynamics/{what}", 0.0)
            for what in ("damping", "friction", "spring_stiffness")
        ]
        effort = number(axis, "limit/effort", math.inf)
        return {
            "axis": _motion(joint, axis),
            "limits": limits,
            "effort_limit": self.physics.effort_of(effort) if effort >= 0 else math.inf,
            "friction": sum(passive),
            "initial_position": self.drives.state()[0, index],
        }

    def coupled(self, pairs: tuple[Coupling, ...]) -> bool:
        return all(self._coupled(pair.leader, pair.follower) for pair in pairs)

    def _coupled(self, first: str, other: str) -> bool:
        if not self.physics.coupled:
            return bool(self.drives.leads(first, other))
        mimic = self._joint(other).find("axis/mimic")
        if mimic is None or mimic.get("joint") != first:
            return False
        return number(mimic, "multiplier", 1.0) == 1.0 and number(mimic, "offset", 0.0) == 0.0

    def _joint(self, name: str) -> ET.Element:
        joints = self._models[self._robot].findall("joint")
        return next(joint for joint in joints if joint.get("name") == name)

    def _plane(self) -> tuple[FloatArray, FloatArray]:
        """The ground: its normal and a point of it, in the world."""
        collision = self.ground.element.find("collision")
        assert collision is not None
        element = collision.find("geometry/plane/normal")
        assert element is not None
        frame = pose(self.ground.link.world_pose(self.server.ecm)) * pose_in(collision)
        return frame.rotation() @ numbers(element), np.asarray(frame.position)

    def collide(self, first: Part, second: Part) -> Any:
        if first in self.links.values() and second in self.links.values():
            return [truth(self._models[self._robot], "self_collide", False)]
        masks = (
            [
                int(number(collision, "surface/contact/collide_bitmask", EVERYTHING))
                for collision in part.element.findall("collision")
            ]
            for part in (first, second)
        )
        return [x & y for x, y in product(*masks)]


def _outline(solid: ET.Element, at: Pose) -> Outline:
    """Of a shape of SDF at a pose."""
    if solid.tag == "box":
        size = solid.find("size")
        assert size is not None
        return a_box(numbers(size), at)
    if solid.tag == "mesh":
        return a_mesh(_points(solid), at)
    radius, length = (number(solid, what, 0.0) for what in ("radius", "length"))
    return (a_cylinder if solid.tag == "cylinder" else a_round)(radius, length, at)


def _points(mesh: ET.Element) -> FloatArray:
    """Corners of a mesh in its collision's frame, (n, 3) [m]."""
    uri, scale = mesh.find("uri"), mesh.find("scale")
    assert uri is not None
    path = unquote(urlparse((uri.text or "").strip()).path)
    return np.asarray(mesh_corners(path) * (1.0 if scale is None else numbers(scale)))


def _motion(joint: ET.Element, axis: ET.Element) -> FloatArray:
    """Velocity of the child's frame at unit joint speed, in that frame: angular, linear, (6,)."""
    xyz = axis.find("xyz")
    assert xyz is not None
    frame: Pose = pose_in(joint)  # in the child's
    direction = frame.rotation() @ numbers(xyz)
    direction = direction / np.linalg.norm(direction)
    slides = joint.get("type") == "prismatic"
    return subspace(direction, np.asarray(frame.position), slides=slides)


def vector(found: Any) -> FloatArray:
    """A gz.math.Vector3d, (3,)."""
    return np.array([found.x(), found.y(), found.z()])


def pose(found: Any) -> Pose:
    """A gz.math.Pose3d."""
    turn = found.rot()
    return Pose.from_array([*vector(found.pos()), turn.w(), turn.x(), turn.y(), turn.z()])


def matrix(found: Any) -> FloatArray:
    """A gz.math.Matrix3d, (3, 3)."""
    return np.array([[found(row, column) for column in range(3)] for row in range(3)])


def pose_in(element: ET.Element) -> Pose:
    """The <pose> of an element of SDF: position, and angles or a quaternion."""
    found = element.find("pose")
    if found is None:
        return Pose()
    x, y, z, *turn = numbers(found)
    if found.get("rotation_format") == "quat_xyzw":
        return Pose((x, y, z), (turn[3], turn[0], turn[1], turn[2]))
    if found.get("degrees") in ("true", "1"):
        turn = list(np.radians(turn))
    return pose_of_rpy((x, y, z), turn)


def number(element: ET.Element, path: str, default: float) -> float:
    """The number at a path below an element of SDF, or SDF's default."""
    found = element.find(path)
    return default if found is None else float(found.text or "")


def truth(element: ET.Element, path: str, default: bool) -> bool:
    """The same for what is true or false."""
    found = element.find(path)
    return default if found is None else (found.text or "").strip() in ("true", "1")


def numbers(element: ET.Element) -> list[float]:
    """The numbers in an element of SDF."""
    return [float(value) for value in (element.text or "").split()]
