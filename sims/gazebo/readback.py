"""What Gazebo says that it built, for the parity check.

Poses, masses, inertias, gravity and the step come from the running world's components. Shapes,
surfaces and joints are told by none of them: they are read from the SDF that the server writes of
its world. The physics engine below the server tells nobody what it has.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from functools import cached_property
from itertools import product
from typing import Any
from urllib.parse import unquote, urlparse

import numpy as np

from pytest_simbench.description.shapes import (
    box_corners,
    cylinder_reach,
    mesh_points,
    outlines,
    placed,
    reach,
    round_reach,
)
from pytest_simbench.parity.quantities import touches
from pytest_simbench.parity.readback import one_value
from pytest_simbench.scene import FloatArray, Pose, Scene
from pytest_simbench.simulator import PreparedRobot

from .bindings import bindings
from .drives import Drives
from .geometry import matrix, number, numbers, pose, pose_in, truth, vector
from .sdf import Physics
from .server import Server

EVERYTHING = 0xFFFF
"""SDF's default of `collide_bitmask`."""


class ReadBack:
    """Reads the quantities of `parity.quantities` that Gazebo tells.

    Args:
        server: runs the world.
        physics: its engine, for how friction is written.
        robot: name of the robot's model.
        drives: of the robot, or None.
        scene, prepared: names of what was built; no value is taken from them.
    """

    def __init__(
        self,
        server: Server,
        physics: Physics,
        robot: str,
        drives: Drives | None,
        scene: Scene,
        prepared: PreparedRobot | None,
    ) -> None:
        self.server, self.physics, self.drives = server, physics, drives
        self.scene, self.prepared, self._robot = scene, prepared, robot
        self.sdf = server.sdf()

    def all(self) -> dict[str, Any]:
        """Every quantity that Gazebo tells, by its name."""
        ground = self._surfaces(self._element("ground"))
        normal, at = self._plane()
        reported: dict[str, Any] = {
            "gravity": vector(self.server.world.gravity(self.server.ecm)),
            "timestep": self.server.timestep,
            "ground/height": at @ normal / normal[2],
            "ground/friction": ground["friction"],
            "ground/restitution": ground["restitution"],
        }
        for body in self.scene.bodies:
            reported |= self._body(body.name)
        if self.prepared is not None and self.drives is not None:
            moving = {link.name for link in self.prepared.moving_links}
            for name in self.prepared.links:
                reported |= self._link(f"link/{name}", name in moving)
            for number_, name in enumerate(self.prepared.robot.joint_names):
                reported |= self._joint(f"joint/{name}", name, number_, self.drives)
            pairs = self.prepared.robot.gripper.couplings
            reported["gripper/coupled"] = float(all(self._coupled(*pair) for pair in pairs))
        return reported | touches(self.scene, self.prepared, self._can_touch)

    def _body(self, name: str) -> dict[str, Any]:
        prefix = f"body/{name}"
        free = not self._model(name).static(self.server.ecm)
        found = self._link(prefix, free)
        found[f"{prefix}/dynamic"] = float(free and not self._flag(prefix, "kinematic", False))
        return found

    def _link(self, prefix: str, moves: bool) -> dict[str, Any]:
        """Pose, shapes and surface of a link, and its inertia if it can move."""
        element, ecm = self._element(prefix), self.server.ecm
        link = self._entity(prefix)
        frame = pose(link.world_pose(ecm))
        shapes: dict[str, list[FloatArray]] = {"box": [], "mesh": [], "round": []}
        for collision in element.findall("collision"):
            solid = collision.find("geometry/*")
            assert solid is not None
            kind = solid.tag if solid.tag in shapes else "round"
            shapes[kind].append(_reach(solid, pose_in(collision)))
        found: dict[str, Any] = {f"{prefix}/pose": frame.as_array()}
        found |= outlines(prefix, shapes["box"], shapes["mesh"], shapes["round"])
        surfaces = self._surfaces(element)
        found |= {f"{prefix}/{name}": value for name, value in surfaces.items()}
        if moves:
            inertial = link.world_inertial(ecm)
            at, turn = frame.inverse(), frame.rotation()
            found[f"{prefix}/mass"] = inertial.mass_matrix().mass()
            found[f"{prefix}/com"] = (at * pose(inertial.pose())).position
            found[f"{prefix}/inertia"] = turn.T @ matrix(inertial.moi()) @ turn
            found[f"{prefix}/gravity"] = float(self._flag(prefix, "gravity", True))
        return found

    def _surfaces(self, element: ET.Element) -> dict[str, Any]:
        """Friction and restitution of a link's shapes, in a pair with others like it; of a lone
        body and the ground, of that pair."""
        collisions = element.findall("collision")
        if not collisions:
            return {}
        pairs = [(value, value) for value in self._frictions(element)]
        if self.physics.lone:
            (body,) = self.scene.bodies
            ground, other = map(self._element, ("ground", f"body/{body.name}"))
            pairs = list(product(self._frictions(ground), self._frictions(other)))
        bounces = [
            number(collision, "surface/bounce/restitution_coefficient", 0.0) ** 2
            for collision in collisions
        ]
        friction = [self.physics.friction_of(*pair) for pair in pairs]
        return {"friction": one_value(friction), "restitution": one_value(bounces)}

    def _frictions(self, element: ET.Element) -> list[float]:
        """What a link's shapes have as friction."""
        return [
            number(collision, f"surface/friction/{name}", 1.0)
            for collision in element.findall("collision")
            for name in self.physics.friction_names
        ]

    def _joint(self, prefix: str, name: str, index: int, drives: Drives) -> dict[str, Any]:
        joint, zero = self._joints[name], float(drives.zeros[index])
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
            f"{prefix}/axis": _motion(joint, axis),
            f"{prefix}/limits": limits,
            f"{prefix}/effort_limit": self.physics.effort_of(effort) if effort >= 0 else math.inf,
            f"{prefix}/friction": sum(passive),
            f"{prefix}/initial_position": drives.state()[0, index],
        }

    def _coupled(self, first: str, other: str) -> bool:
        if not self.physics.coupled:
            return self.drives is not None and self.drives.leads(first, other)
        mimic = self._joints[other].find("axis/mimic")
        if mimic is None or mimic.get("joint") != first:
            return False
        return number(mimic, "multiplier", 1.0) == 1.0 and number(mimic, "offset", 0.0) == 0.0

    def _plane(self) -> tuple[FloatArray, FloatArray]:
        """The ground: its normal and a point of it, in the world."""
        collision = self._element("ground").find("collision")
        assert collision is not None
        element = collision.find("geometry/plane/normal")
        assert element is not None
        frame = pose(self._entity("ground").world_pose(self.server.ecm)) * pose_in(collision)
        return frame.rotation() @ numbers(element), np.asarray(frame.position)

    def _can_touch(self, a: str, b: str) -> bool:
        if a.startswith("link/") and b.startswith("link/"):
            return truth(self._models[self._robot], "self_collide", False)
        first, second = (
            [
                int(number(collision, "surface/contact/collide_bitmask", EVERYTHING))
                for collision in self._element(name).findall("collision")
            ]
            for name in (a, b)
        )
        return bool(first and second) and all(x & y for x in first for y in second)

    def _flag(self, name: str, what: str, default: bool) -> bool:
        return truth(self._element(name), what, default)

    @cached_property
    def _models(self) -> dict[str, ET.Element]:
        return {model.get("name", ""): model for model in self.sdf.findall("model")}

    @cached_property
    def _joints(self) -> dict[str, ET.Element]:
        model = self._models[self._robot]
        return {joint.get("name", ""): joint for joint in model.findall("joint")}

    def _place(self, name: str) -> tuple[str, str]:
        """Model and link in Gazebo of "ground", `body/NAME` or `link/NAME`."""
        kind, _, rest = name.partition("/")
        return (self._robot, rest) if kind == "link" else (rest or kind, "link")

    def _element(self, name: str) -> ET.Element:
        model, link = self._place(name)
        for element in self._models[model].findall("link"):
            if element.get("name") == link:
                return element
        raise KeyError(name)

    def _model(self, name: str) -> Any:
        sim, ecm = bindings().sim, self.server.ecm
        return sim.Model(self.server.world.model_by_name(ecm, name))

    def _entity(self, name: str) -> Any:
        model, link = self._place(name)
        return bindings().sim.Link(self._model(model).link_by_name(self.server.ecm, link))


def _reach(solid: ET.Element, at: Pose) -> FloatArray:
    """The reach of a shape of SDF at a pose."""
    if solid.tag == "box":
        size = solid.find("size")
        assert size is not None
        return reach(placed(box_corners(numbers(size)), at))
    if solid.tag == "mesh":
        return reach(placed(_points(solid), at))
    radius, length = (number(solid, what, 0.0) for what in ("radius", "length"))
    return (cylinder_reach if solid.tag == "cylinder" else round_reach)(radius, length, at)


def _points(mesh: ET.Element) -> FloatArray:
    """Corners of a mesh in its collision's frame, (n, 3) [m]."""
    uri, scale = mesh.find("uri"), mesh.find("scale")
    assert uri is not None
    path = unquote(urlparse((uri.text or "").strip()).path)
    return np.asarray(mesh_points(path) * (1.0 if scale is None else numbers(scale)))


def _motion(joint: ET.Element, axis: ET.Element) -> FloatArray:
    """Velocity of the child's frame at unit joint speed, in that frame: angular, linear, (6,)."""
    xyz = axis.find("xyz")
    assert xyz is not None
    frame: Pose = pose_in(joint)  # in the child's
    direction = frame.rotation() @ numbers(xyz)
    direction = direction / np.linalg.norm(direction)
    if joint.get("type") == "prismatic":
        return np.concatenate([np.zeros(3), direction])
    return np.concatenate([direction, np.cross(frame.position, direction)])
