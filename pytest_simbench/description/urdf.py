"""The robot's description, reduced to what every engine reads alike.

URDF importers differ in what they make of package paths, fixed joints, zero-mass frames, mimic
joints, passive damping and visual meshes. So all of them get the same reduced description: mesh
paths absolute, fixed joints merged into the link above (masses and inertias added), the base
placed, no mimic joint (adapters couple the fingers), no passive damping, and the collision shapes
as visual shapes too.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pytest_simbench.description.urdf_check import Description
from pytest_simbench.ground.errors import DescriptionError
from pytest_simbench.scene import Body, ConvexMesh, FloatArray, Polytope, Pose, Robot, Vector3
from pytest_simbench.scene.checks import Wire
from pytest_simbench.scene.pose import vector3

ROOT, FIXED_ROOT = "base", "fixed base"
"""Link of a reduced robot that is fixed in the world; and its name where a `base` moves."""

INERTIA = {f"i{'xyz'[row]}{'xyz'[k]}": (row, k) for row in range(3) for k in range(row, 3)}
"""Attributes of a URDF's tensor, ixx, ixy, ..., izz, and where each stands in it."""


@dataclass(frozen=True)
class Shape:
    """A collision shape: a box with `size` [m], or a mesh with its file; `pose` in the link."""

    pose: Pose
    size: Vector3 | None = None
    mesh: str | None = None


@dataclass
class Link:
    """A rigid link: mass [kg], centre of mass [m] and inertia about it [kg m^2], link axes."""

    name: str
    mass: float = 0.0
    centre: FloatArray = field(default_factory=lambda: np.zeros(3))
    inertia: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))
    shapes: list[Shape] = field(default_factory=list)

    def absorb(self, other: Link, pose: Pose) -> None:
        """Weld `other`, placed at `pose` in this link's frame, onto this link."""
        rotation, offset = pose.rotation(), np.asarray(pose.position)
        centre = rotation @ other.centre + offset
        total = self.mass + other.mass
        if total > 0:
            middle = (self.mass * self.centre + other.mass * centre) / total
            self.inertia = _about(self.inertia, self.mass, self.centre - middle) + _about(
                rotation @ other.inertia @ rotation.T, other.mass, centre - middle
            )
            self.mass, self.centre = total, middle
        self.shapes += [Shape(pose * s.pose, s.size, s.mesh) for s in other.shapes]


@dataclass(frozen=True)
class MovingJoint(Wire):
    """A revolute or prismatic joint between two links of the reduced robot."""

    name: str
    kind: str
    parent: str
    child: str
    origin: Pose
    axis: Vector3


class PreparedRobot:
    """The reduced robot.

    Attributes:
        root: the link fixed in the world, its frame the world's.
        joints: the moving joints, parents first.
        links: all links by name.
        limits: lower and upper position of each joint [rad or m], (2,).
        velocity_limits: of each joint [rad/s or m/s].
        places: where each link of the file is: the link that it became part of, and its pose there.

    Raises:
        DescriptionError: the file cannot be read or used (see `urdf_check`), or does not fit the
            robot's drives.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self._description = Description(robot.urdf, robot.packages)
        raw = {name: self._read_link(e) for name, e in self._description.links.items()}
        joints, root = self._description.joints, self._description.root
        kinds = {_required(joint, "child").attrib["link"]: joint.attrib["type"] for joint in joints}
        self.root = ROOT if kinds.get(ROOT, "fixed") == "fixed" else FIXED_ROOT
        self.links: dict[str, Link] = {self.root: Link(self.root)}
        self.joints: list[MovingJoint] = []
        self.limits: dict[str, FloatArray] = {}
        self.velocity_limits: dict[str, float] = {}
        self.places: dict[str, tuple[str, Pose]] = {}
        self.links[self.root].absorb(raw[root], robot.base)
        self._descend(root, self.root, robot.base, joints, raw)
        self._check_drives(raw)

    def _check_drives(self, raw: Mapping[str, Link]) -> None:
        """The drives and the tool are those of the file, and what is moved has a mass."""
        robot = self.robot
        missing = set(robot.joint_names) ^ {joint.name for joint in self.joints}
        if missing:
            raise DescriptionError(
                f"{robot.urdf} and the drives of {robot.name} disagree about joints "
                f"{', '.join(sorted(missing))}"
            )
        if robot.tool_frame not in raw:
            raise DescriptionError(
                f"the tool frame {robot.tool_frame!r} of {robot.name} is no link of {robot.urdf}; "
                f"choose from {', '.join(raw)}"
            )
        for joint in self.joints:
            if not self.links[joint.child].mass > 0:
                raise DescriptionError(
                    f"{robot.urdf}: link {joint.child!r} is moved by joint {joint.name!r} and has "
                    "no mass; give it an <inertial>"
                )
        for drive in robot.joints:
            lower, upper = self.limits[drive.name]
            if not lower <= drive.initial_position <= upper:
                raise DescriptionError(
                    f"joint {drive.name!r} of {robot.name} starts at {drive.initial_position:g}, "
                    f"and {robot.urdf} lets it go from {lower:g} to {upper:g}"
                )

    @property
    def gravity(self) -> dict[str, float]:
        """Share of the scene's gravity that each moving link feels, by its name."""
        shares = {joint.name: joint.gravity for joint in self.robot.joints}
        return {joint.child: shares[joint.name] for joint in self.joints}

    @property
    def moving_links(self) -> list[Link]:
        return [self.links[joint.child] for joint in self.joints]

    def _descend(
        self, name: str, into: str, pose: Pose, joints: list[ET.Element], raw: dict[str, Link]
    ) -> None:
        """Attach what hangs on raw link `name`, which sits at `pose` in reduced link `into`."""
        self.places[name] = into, pose
        for joint in joints:
            if _required(joint, "parent").attrib["link"] != name:
                continue
            moved, kind = joint.attrib["name"], joint.attrib["type"]
            child, origin = _required(joint, "child").attrib["link"], pose * origin_of(joint)
            if kind == "fixed":
                self.links[into].absorb(raw[child], origin)
                self._descend(child, into, origin, joints, raw)
                continue
            limit, told = _required(joint, "limit").attrib, joint.find("axis")
            axis = numbers("1 0 0" if told is None else told.attrib["xyz"])
            self.joints.append(MovingJoint(moved, kind, into, child, origin, axis))
            self.limits[moved] = np.array([float(limit["lower"]), float(limit["upper"])])
            self.velocity_limits[moved] = float(limit["velocity"])
            self.links[child] = raw[child]
            self._descend(child, child, Pose(), joints, raw)

    def _read_link(self, element: ET.Element) -> Link:
        link = Link(element.attrib["name"])
        inertial = element.find("inertial")
        if inertial is not None:
            mass, i = inertial.find("mass"), inertial.find("inertia")
            if mass is not None and i is not None:
                pose = origin_of(inertial)
                tensor = np.zeros((3, 3))
                for key, (row, column) in INERTIA.items():
                    tensor[row, column] = tensor[column, row] = float(i.attrib[key])
                link.mass = float(mass.attrib["value"])
                link.centre = np.asarray(pose.position)
                link.inertia = pose.rotation() @ tensor @ pose.rotation().T
        for collision in element.findall("collision"):
            box, mesh = collision.find("geometry/box"), collision.find("geometry/mesh")
            if box is not None:
                link.shapes.append(Shape(origin_of(collision), size=numbers(box.attrib["size"])))
            elif mesh is not None:
                path = self._description.meshes[mesh.attrib["filename"]]
                link.shapes.append(Shape(origin_of(collision), mesh=path))
        return link

    def to_urdf(self, *, mimic: bool = False, visuals: bool = True) -> str:
        """The reduced robot as URDF text.

        Args:
            mimic: say that the other fingers follow the first.
        """
        root = ET.Element("robot", name=self.robot.name)
        for link in self.links.values():
            write_link(root, link, visuals)
        for joint in self.joints:
            drive = self.robot.joints[self.robot.joint_names.index(joint.name)]
            fastest = self.velocity_limits[joint.name]
            element = write_joint(root, joint, self.limits[joint.name], drive.effort_limit, fastest)
            fingers = self.robot.gripper.joints
            if mimic and joint.name in fingers[1:]:
                ET.SubElement(element, "mimic", joint=fingers[0], multiplier="1", offset="0")
        # One engine reads files in pieces of 1024 bytes a line and may cut an attribute in two.
        ET.indent(root)
        return ET.tostring(root, encoding="unicode")

    def write_urdf(self, directory: str | Path, **options: bool) -> Path:
        """Write the reduced robot into a file of `directory`, for engines that read only files; the
        options are those of `to_urdf`."""
        path = Path(directory) / f"{self.robot.name}.urdf"
        path.write_text(self.to_urdf(**options), encoding="utf-8")
        return path


def body_urdf(body: Body, mesh: Callable[[str, Polytope], Path]) -> str:
    """A body as URDF text, its frame the one link's: for engines that take moments of inertia, many
    shapes or a mesh from there alone.

    Args:
        body: a free one, or a fixed one, which has no mass there.
        mesh: writes the hull of a mesh, given a name for it; the file.
    """
    root = ET.Element("robot", name="body")  # names of the scene may hold what an engine's may not
    link = ET.SubElement(root, "link", name="body")
    if body.mass:
        _write_inertial(link, Link("body", body.mass, inertia=np.diag(body.inertia())))
    for k, part in enumerate(body.parts):
        if isinstance(part, ConvexMesh):
            kind, written = "mesh", {"filename": str(mesh(str(k), part.hull))}
        else:
            size = {n: getattr(part, n) for n in ("size", "radius", "length") if hasattr(part, n)}
            kind = part.kind
            written = {name: _spaced(np.atleast_1d(value)) for name, value in size.items()}
        for tag in ("visual", "collision"):
            element = ET.SubElement(link, tag)
            write_origin(element, part.pose)
            ET.SubElement(ET.SubElement(element, "geometry"), kind, written)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode")


def _about(inertia: FloatArray, mass: float, offset: FloatArray) -> FloatArray:
    """Inertia about a point `offset` away from the centre of mass (Steiner)."""
    steiner = mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    return np.asarray(inertia + steiner)


def _required(element: ET.Element, tag: str) -> ET.Element:
    found = element.find(tag)
    assert found is not None  # the file was checked
    return found


def numbers(text: str) -> Vector3:
    """The three numbers of an attribute.

    Raises:
        ValueError: they are none.
    """
    return vector3(map(float, text.split()))


def origin_of(element: ET.Element) -> Pose:
    """Pose of an element's <origin>; URDF angles are roll, pitch, yaw about fixed axes."""
    origin = element.find("origin")
    if origin is None:
        return Pose()
    xyz, rpy = (numbers(origin.attrib.get(key, "0 0 0")) for key in ("xyz", "rpy"))
    return pose_of_rpy(xyz, rpy)


def pose_of_rpy(xyz: Sequence[float], rpy: Sequence[float]) -> Pose:
    """A pose as a URDF writes it: position [m]; roll, pitch and yaw about fixed axes [rad]."""
    x, y, z = xyz
    roll, pitch, yaw = np.array(rpy) / 2
    turns = [
        Pose(quaternion=(np.cos(yaw), 0.0, 0.0, np.sin(yaw))),
        Pose(quaternion=(np.cos(pitch), 0.0, np.sin(pitch), 0.0)),
        Pose(quaternion=(np.cos(roll), np.sin(roll), 0.0, 0.0)),
    ]
    quaternion = (turns[0] * turns[1] * turns[2]).quaternion
    return Pose((x, y, z), quaternion)


def _spaced(values: Any) -> str:
    return " ".join(repr(float(value)) for value in values)


def write_origin(element: ET.Element, pose: Pose) -> None:
    """Give an element an <origin>."""
    r = pose.rotation()
    pitch = np.arcsin(np.clip(-r[2, 0], -1.0, 1.0))
    roll, yaw = np.arctan2(r[2, 1], r[2, 2]), np.arctan2(r[1, 0], r[0, 0])
    if np.hypot(r[0, 0], r[1, 0]) < 1e-7:  # pitched by 90 degrees both turn about one axis
        roll, yaw = 0.0, np.arctan2(-r[0, 1], r[1, 1])
    ET.SubElement(element, "origin", xyz=_spaced(pose.position), rpy=_spaced((roll, pitch, yaw)))


def write_link(root: ET.Element, link: Link, visuals: bool = True) -> None:
    """Add a link, its collision shapes as visual ones too where it is asked for."""
    element = ET.SubElement(root, "link", name=link.name)
    if link.mass > 0:
        _write_inertial(element, link)
    for shape in link.shapes:
        for tag in ("visual", "collision") if visuals else ("collision",):
            _write_shape(ET.SubElement(element, tag), shape)


def write_joint(
    root: ET.Element, joint: MovingJoint, limits: Iterable[float], effort: float, fastest: float
) -> ET.Element:
    """Add a joint, its limits [rad or m], largest effort [N m or N] and speed [rad/s or m/s]."""
    element = ET.SubElement(root, "joint", name=joint.name, type=joint.kind)
    write_origin(element, joint.origin)
    ET.SubElement(element, "parent", link=joint.parent)
    ET.SubElement(element, "child", link=joint.child)
    ET.SubElement(element, "axis", xyz=_spaced(joint.axis))
    lower, upper = (repr(float(limit)) for limit in limits)
    ET.SubElement(
        element, "limit", lower=lower, upper=upper, effort=repr(effort), velocity=repr(fastest)
    )
    return element


def _write_inertial(element: ET.Element, link: Link) -> None:
    inertial = ET.SubElement(element, "inertial")
    ET.SubElement(inertial, "origin", xyz=_spaced(link.centre), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=repr(float(link.mass)))
    values = {name: repr(float(link.inertia[at])) for name, at in INERTIA.items()}
    ET.SubElement(inertial, "inertia", values)


def _write_shape(element: ET.Element, shape: Shape) -> None:
    write_origin(element, shape.pose)
    geometry = ET.SubElement(element, "geometry")
    if shape.size is not None:
        ET.SubElement(geometry, "box", size=_spaced(shape.size))
    elif shape.mesh is not None:
        ET.SubElement(geometry, "mesh", filename=shape.mesh)
