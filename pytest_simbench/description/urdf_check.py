"""Is a robot's description one that an engine can be given? For files that anybody may have made.

`Description` reads a URDF as a whole and refuses it, in a sentence with file, element and what to
do, before any of it reaches an engine: each engine makes something else of what is broken, or
crashes. What is not read here (pictures of links, transmissions) is not given to engines either.
Used in workers too: standard library and numpy only.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from typing import NoReturn
from xml.parsers import expat

import numpy as np

from pytest_simbench.description.mesh_check import check_mesh, mesh_path
from pytest_simbench.ground.errors import DescriptionError
from pytest_simbench.ground.files import FileError, read_file
from pytest_simbench.scene.checks import LARGEST, UNIT_TOLERANCE, SceneError, check_name

MOST_LINKS = 300

MOVING, FIXED = ("revolute", "prismatic"), "fixed"
REFUSED = {
    "continuous": "give it limits and make it revolute",
    "floating": "a robot is fixed in the world; leave the joint out",
    "planar": "use two prismatic joints and a revolute one",
}
"""Joint types of the URDF specification (wiki.ros.org/urdf/XML/joint) that tasks cannot use."""

INERTIA_TOLERANCE = 1e-3
"""How far the largest principal moment may exceed the sum of the others, of their sum: published
tensors are rounded to three or four digits."""


class Description:
    """A URDF that was read and found sound.

    Args:
        change: is given the root element before anything is checked.

    Attributes:
        joints: elements, in the order of the file.
        root: name of the link on which all others hang.
        meshes: absolute path of each mesh, by the name that the file gives it.
        shapes: that a link may collide with, in words.

    Raises:
        DescriptionError: the file is not there, or something in it cannot be; says what.
    """

    shapes = "box or mesh"

    def __init__(
        self,
        path: str,
        packages: Mapping[str, str],
        change: Callable[[ET.Element], None] | None = None,
    ) -> None:
        self.path = path
        self.packages = packages
        self._lines: dict[ET.Element, int] = {}
        self.meshes: dict[str, str] = {}
        self.xml = xml = read_xml(path, "the robot description", self._lines)
        if change is not None:
            change(xml)
        if xml.tag != "robot":
            raise DescriptionError(f"{path} is no URDF: it holds <{xml.tag}>, not <robot>")
        for element in xml.iter():
            if element.tag.startswith("xacro:"):
                raise DescriptionError(
                    f"{path}, line {self._lines[element]}: <{element.tag}> is of xacro, "
                    "which nothing here expands; do that first (xacro FILE > NAME.urdf)"
                )
        self.links = self._named(xml.findall("link"))
        self.joints = list(self._named(xml.findall("joint")).values())
        if not 0 < len(self.links) <= MOST_LINKS:
            raise DescriptionError(
                f"{path} has {len(self.links)} links; a robot has one at least and {MOST_LINKS} "
                "at most"
            )
        for link in self.links.values():
            self._check_link(link)
        for joint in self.joints:
            self._check_joint(joint)
        self.root = self._check_tree()
        self._check_mimics()

    def refuse(self, element: ET.Element, why: str, inside: ET.Element | None = None) -> NoReturn:
        """Raise the error about an element, with its line."""
        line = self._lines.get(element if inside is None else inside, 0)
        name = element.get("name", "")
        raise DescriptionError(f"{self.path}, line {line}: {element.tag} {name!r} {why}")

    def _named(self, elements: list[ET.Element]) -> dict[str, ET.Element]:
        found: dict[str, ET.Element] = {}
        for element in elements:
            name = element.get("name")
            try:
                check_name(name, f"{self.path}, line {self._lines[element]}: a {element.tag}")
            except SceneError as error:
                raise DescriptionError(str(error)) from None
            assert name is not None
            if name in found:
                first = self._lines[found[name]]
                self.refuse(element, f"is there already, in line {first}; give it another name")
            found[name] = element
        return found

    # Numbers

    def numbers(
        self, owner: ET.Element, element: ET.Element, key: str, count: int, default: str = ""
    ) -> list[float]:
        """So many finite numbers in an attribute of `element`, which is in `owner`."""
        text = element.get(key, default)
        what = f"has <{element.tag} {key}={text[:80]!r}>"
        try:
            found = [_plain_float(part) for part in text.split()]
        except ValueError:
            found = []
        if len(found) != count:
            many = "a number" if count == 1 else f"{count} numbers"
            self.refuse(
                owner, f"{what}; give {many}, for instance {'0 ' * count}".rstrip(), element
            )
        for number in found:
            if not abs(number) <= LARGEST:
                self.refuse(owner, f"{what}; give finite numbers up to {LARGEST:g}", element)
        return found

    def number(self, owner: ET.Element, element: ET.Element, key: str, default: str = "") -> float:
        return self.numbers(owner, element, key, 1, default)[0]

    def _origin(self, owner: ET.Element, holder: ET.Element) -> None:
        for origin in self._at_most_one(owner, holder, "origin"):
            self.numbers(owner, origin, "xyz", 3, "0 0 0")
            self.numbers(owner, origin, "rpy", 3, "0 0 0")

    def _at_most_one(self, owner: ET.Element, holder: ET.Element, tag: str) -> list[ET.Element]:
        found = holder.findall(tag)
        if len(found) > 1:
            self.refuse(owner, f"has {len(found)} <{tag}>; leave one", found[1])
        return found

    def _only(self, owner: ET.Element, holder: ET.Element, tag: str) -> ET.Element:
        found = self._at_most_one(owner, holder, tag)
        if not found:
            self.refuse(owner, f"has no <{tag}>; give it one", holder)
        return found[0]

    # Links

    def _check_link(self, link: ET.Element) -> None:
        for inertial in self._at_most_one(link, link, "inertial"):
            self._check_inertial(link, inertial)
        for collision in link.findall("collision"):
            self._origin(link, collision)
            self._check_geometry(link, self._only(link, collision, "geometry"))

    def _check_inertial(self, link: ET.Element, inertial: ET.Element) -> None:
        self._origin(link, inertial)
        mass = self.number(link, self._only(link, inertial, "mass"), "value")
        tensor = self._only(link, inertial, "inertia")
        xx, xy, xz, yy, yz, zz = (
            self.number(link, tensor, key) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        )
        if mass < 0:
            self.refuse(link, f"has the mass {mass:g} kg; it must be 0 or more", inertial)
        moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        slack = INERTIA_TOLERANCE * float(np.abs(moments).sum())
        told = ", ".join(f"{moment:.3g}" for moment in moments)
        if moments[0] < -slack or (mass > 0 and not moments[0] > 0):
            self.refuse(
                link, f"has the principal moments {told} kg m^2; they must be positive", tensor
            )
        if moments[2] > moments[0] + moments[1] + slack:
            self.refuse(
                link,
                f"has the principal moments {told} kg m^2; of a body, none is larger than the "
                "other two together",
                tensor,
            )
        if mass == 0 and moments[2] > 0:
            self.refuse(link, "has moments of inertia and no mass; give it a mass", inertial)

    def _check_geometry(self, link: ET.Element, geometry: ET.Element) -> None:
        shapes = list(geometry)
        if len(shapes) != 1 or shapes[0].tag not in ("box", "mesh"):
            told = ", ".join(f"<{shape.tag}>" for shape in shapes) or "nothing"
            self.refuse(
                link, f"has a collision shape of {told}; it must be one {self.shapes}", geometry
            )
        (shape,) = shapes
        if shape.tag == "box":
            if min(self.numbers(link, shape, "size", 3)) <= 0:
                size = shape.get("size")
                self.refuse(link, f"has a box of size {size!r}; edges are longer than 0", shape)
            return
        if self.numbers(link, shape, "scale", 3, "1 1 1") != [1.0, 1.0, 1.0]:
            self.refuse(
                link,
                f"has a mesh with scale={shape.get('scale')!r}, which engines apply differently; "
                "scale the mesh file itself",
                shape,
            )
        name = shape.get("filename", "")
        if name in self.meshes:
            return
        try:
            path = mesh_path(name, self.path, self.packages)
            check_mesh(path)
        except FileError as error:
            self.refuse(link, f"has a mesh that cannot be used: {error}", shape)
        self.meshes[name] = str(path)

    # Joints

    def _check_joint(self, joint: ET.Element) -> None:
        kind = joint.get("type", "")
        if kind in REFUSED:
            self.refuse(joint, f"is {kind}, which no task can drive: {REFUSED[kind]}")
        if kind not in (*MOVING, FIXED):
            self.refuse(joint, f"has the type {kind!r}; choose from {', '.join((*MOVING, FIXED))}")
        self._origin(joint, joint)
        ends = []
        for tag in ("parent", "child"):
            end = self._only(joint, joint, tag)
            link = end.get("link", "")
            if link not in self.links:
                self.refuse(joint, f"has the {tag} {link!r}, which is no link of the file", end)
            ends.append(link)
        if ends[0] == ends[1]:
            self.refuse(joint, f"joins link {ends[0]!r} to itself")
        if kind == FIXED:
            return
        for axis in self._at_most_one(joint, joint, "axis"):
            length = math.hypot(*self.numbers(joint, axis, "xyz", 3))
            if abs(length - 1) > UNIT_TOLERANCE:
                xyz = axis.get("xyz")
                self.refuse(joint, f"has the axis {xyz!r}; give it the length 1, as 0 0 1", axis)
        limit = self._only(joint, joint, "limit")
        lower, upper = (self.number(joint, limit, key) for key in ("lower", "upper"))
        if not lower < upper:
            self.refuse(
                joint, f"may go from {lower:g} to {upper:g}; lower must be below upper", limit
            )
        for key, default in (("effort", "0"), ("velocity", "")):
            if self.number(joint, limit, key, default) < 0:
                value = limit.get(key)
                self.refuse(joint, f"has the {key} limit {value!r}; it must be positive", limit)

    def _check_mimics(self) -> None:
        """Followers name a moving joint, and none follows itself, directly or through others."""
        moving = {j.attrib["name"]: j for j in self.joints if j.attrib["type"] in MOVING}
        follows: dict[str, str] = {}
        for name, joint in moving.items():
            for mimic in self._at_most_one(joint, joint, "mimic"):
                for key, default in (("multiplier", "1"), ("offset", "0")):
                    self.number(joint, mimic, key, default)
                leader = mimic.get("joint", "")
                if leader not in moving:
                    self.refuse(joint, f"follows {leader!r}, which is no moving joint", mimic)
                follows[name] = leader
        for name in follows:
            leader, seen = name, set()
            while leader in follows and leader not in seen:
                seen.add(leader)
                leader = follows[leader]
            if leader in seen:
                self.refuse(moving[name], "follows itself (<mimic>); let one of the joints lead")

    def _check_tree(self) -> str:
        """The root; every link hangs on it by one way."""
        above: dict[str, ET.Element] = {}
        below: dict[str, list[str]] = {}
        for joint in self.joints:
            parent, child = (
                self._only(joint, joint, tag).attrib["link"] for tag in ("parent", "child")
            )
            if child in above:
                other = above[child].get("name")
                self.refuse(joint, f"leads to link {child!r}, to which joint {other!r} leads too")
            above[child] = joint
            below.setdefault(parent, []).append(child)
        roots = [name for name in self.links if name not in above]
        if len(roots) != 1:
            told = f": {', '.join(roots[:5])}" if roots else ", since its joints run in a circle"
            raise DescriptionError(
                f"{self.path} has {len(roots)} root links, not one{told}; a robot is one tree"
            )
        reached, waiting = set(), roots[:]
        while waiting:
            name = waiting.pop()
            reached.add(name)
            waiting += below.get(name, ())
        circle = [name for name in self.links if name not in reached]
        if circle:
            raise DescriptionError(
                f"{self.path}: the joints of {', '.join(circle[:5])} run in a circle, which hangs "
                "on nothing; a robot is one tree"
            )
        return roots[0]


def _plain_float(text: str) -> float:
    """A number as XML Schema writes one: no `1_000`, which Python takes and engines do not."""
    if "_" in text:
        raise ValueError(text)
    return float(text)


LARGEST_FILE = 16 * 2**20
"""Of a URDF or SRDF file [bytes]; the largest in example-robot-data have 0.3 MB."""

MOST_ELEMENTS = 100_000


def read_xml(path: str, what: str, lines: dict[ET.Element, int] | None = None) -> ET.Element:
    """The root element of an XML file without a document type, which could define entities.

    Args:
        lines: takes the line of each element.

    Raises:
        DescriptionError: no file, too large, or no such XML.
    """
    try:
        data = read_file(path, LARGEST_FILE, what)
    except FileError as error:
        raise DescriptionError(str(error)) from None
    builder, parser = ET.TreeBuilder(), expat.ParserCreate()
    count = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if count > MOST_ELEMENTS:
            raise DescriptionError(f"{path} has more than {MOST_ELEMENTS} elements")
        element = builder.start(tag, attributes)
        if lines is not None:
            lines[element] = parser.CurrentLineNumber

    def refuse(*_: object) -> None:
        raise DescriptionError(
            f"{path}, line {parser.CurrentLineNumber}: {what} has a document type (<!DOCTYPE>), "
            "which may define entities; leave it out"
        )

    handlers: dict[str, Callable[..., object]] = {
        "StartElementHandler": start,
        "EndElementHandler": builder.end,
        "CharacterDataHandler": builder.data,
        "StartDoctypeDeclHandler": refuse,
        "EntityDeclHandler": refuse,
    }
    for name, handler in handlers.items():
        setattr(parser, name, handler)
    try:
        parser.Parse(data, True)
    except (expat.ExpatError, ValueError, LookupError) as error:
        raise DescriptionError(f"{what} {path} is not valid XML: {error}") from None
    return builder.close()
