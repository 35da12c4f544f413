"""A robot's description as content: it travels to workers without any path of the client's.

A description is one URDF without what no engine is given (pictures of links, transmissions), and
the meshes that it names, each called by the digest of its content. Where it arrives it is kept in a
folder under these names, so the same description always lies in the same place: engines keep
compiled meshes by path. Used in workers too: standard library and numpy only.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from contextlib import suppress
from copy import deepcopy
from functools import cache, lru_cache, wraps
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, TypeVar

from pytest_simbench.description.mesh_check import LARGEST_MESH
from pytest_simbench.description.urdf_check import LARGEST_FILE, Description
from pytest_simbench.ground.errors import DescriptionError
from pytest_simbench.ground.files import FileError, read_file
from pytest_simbench.scene import Robot

P = ParamSpec("P")
T = TypeVar("T")

CONTENT = "content"
"""Key under which a robot's wire form carries its description."""


def last_change(robot: Robot) -> tuple[int, ...]:
    """When the files were written that describe a robot [ns]: what was read before may be stale."""
    found = _written(robot.urdf, robot.srdf)
    with suppress(DescriptionError):  # whoever reads it tells
        found += _written(*_meshes(robot, found))
    return found


def robot_cache(function: Callable[Concatenate[Robot, P], T]) -> Callable[Concatenate[Robot, P], T]:
    """A function of a robot that is carried out once, until a file of the robot changes."""

    @lru_cache(maxsize=64)
    def found(_: object, robot: Robot, /, *others: P.args, **named: P.kwargs) -> T:
        return function(robot, *others, **named)

    @wraps(function)
    def asked(robot: Robot, /, *others: P.args, **named: P.kwargs) -> T:
        own = robot.limits, robot.swing, robot.stand  # are no part of its equality
        return found((last_change(robot), own), robot, *others, **named)  # type: ignore[arg-type]

    return asked


def _written(*paths: str) -> tuple[int, ...]:
    found = []
    for path in filter(None, paths):
        with suppress(OSError):  # whoever reads it tells
            found.append(os.stat(path).st_mtime_ns)
    return tuple(found)


@lru_cache(maxsize=64)
def _meshes(robot: Robot, changed: tuple[int, ...]) -> tuple[str, ...]:
    """Paths of the meshes that its URDF names."""
    return tuple(Description(robot.urdf, robot.packages).meshes.values())


def description_xml(robot: Robot) -> ET.Element:
    """Links and joints of a robot's URDF, collision shapes only, the absolute paths of its meshes.

    Raises:
        DescriptionError: a file is missing or wrong; says which.
    """
    return _collision_xml(Description(robot.urdf, robot.packages), robot.name, str)


def _collision_xml(checked: Description, name: str, name_of: Callable[[Path], str]) -> ET.Element:
    """The same of a description that was read, its meshes named anew."""
    root = ET.Element("robot", name=name)
    for element in deepcopy(checked.xml):
        if element.tag not in ("link", "joint"):
            continue
        for visual in element.findall("visual"):
            element.remove(visual)
        for mesh in element.iterfind("collision/geometry/mesh"):
            mesh.set("filename", name_of(Path(checked.meshes[mesh.attrib["filename"]])))
        root.append(element)
    return root


def content_of(robot: Robot) -> dict[str, Any]:
    """The description as plain data: `urdf`, a text, and `meshes`, bytes by name.

    Raises:
        DescriptionError: a file is missing or wrong; says which.
    """
    return dict(_content_of(robot))


@robot_cache
def _content_of(robot: Robot) -> dict[str, Any]:
    return content(Description(robot.urdf, robot.packages), robot.name)


def content(checked: Description, name: str) -> dict[str, Any]:
    """The same of a description that was read, for a robot of that name."""
    meshes: dict[str, bytes] = {}

    def name_of(path: Path) -> str:
        data = read_file(path, LARGEST_MESH, "the mesh")
        name = f"{digest(data)}{path.suffix.lower()}"
        meshes[name] = data
        return name

    xml = _collision_xml(checked, name, name_of)
    return {"urdf": ET.tostring(xml, encoding="unicode"), "meshes": meshes}


def with_content(wire: dict[str, Any], robot: Robot | None) -> dict[str, Any]:
    """A scene's wire form with the description of its robot in place of paths."""
    if robot is None:
        return wire
    paths = {"urdf": "", "srdf": "", "packages": {}}
    return {**wire, "robot": {**wire["robot"], **paths, CONTENT: content_of(robot)}}


def received(wire: Mapping[str, Any]) -> dict[str, Any]:
    """A scene's wire form with paths of this machine, where it carries a description.

    Raises:
        OSError: the description cannot be kept here.
    """
    robot = dict(wire.get("robot") or {})
    if CONTENT not in robot:
        return dict(wire)
    content = robot.pop(CONTENT)
    return {**wire, "robot": {**robot, "urdf": str(keep(content["urdf"], content["meshes"]))}}


def keep(
    urdf: str | ET.Element, meshes: Mapping[str, bytes] | None = None, ending: str = ".urdf"
) -> Path:
    """Write a description into the folder of this machine, unless it is there; where the URDF is.

    Raises:
        OSError: it cannot be written.
    """
    for name, data in (meshes or {}).items():
        _write(folder() / Path(name).name, data)
    text = (urdf if isinstance(urdf, str) else ET.tostring(urdf, encoding="unicode")).encode()
    return _write(folder() / f"{digest(text)}{ending}", text)


def keep_mesh(data: bytes) -> Path:
    """Write a mesh (.stl) into that folder, unless it is there; where it is."""
    return _write(folder() / f"{digest(data)}.stl", data)


def digest(data: bytes) -> str:
    """Of a file, 24 digits."""
    return hashlib.sha256(data).hexdigest()[:24]


@cache
def folder() -> Path:
    """Where descriptions are kept: the user's cache folder, or where that cannot be written a new
    folder of the machine's temporary ones."""
    caches = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    found = Path(caches) / "pytest-simbench" / "robots"
    try:
        found.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=found):
            return found
    except OSError:
        return Path(tempfile.mkdtemp(prefix="simbench-robots-"))


def _write(path: Path, data: bytes) -> Path:
    """Write a file at once, unless it is there as it should be."""
    try:
        if read_file(path, max(LARGEST_MESH, LARGEST_FILE)) == data:
            return path
    except FileError:
        pass
    with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
        file.write(data)
    os.replace(file.name, path)
    return path
