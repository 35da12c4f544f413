"""Meshes that a robot description names: files of the robot, not of the system, and meshes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from pytest_simbench.simulator.files import FileError, read_file

LARGEST_MESH = 64 * 2**20
"""[bytes]; a binary STL of 1.3 million triangles. Engines collide hulls of some thousand."""

FARTHEST = 1e6
"""No vertex is farther from its origin, in the file's unit."""

PACKAGE = "package://"


def mesh_path(filename: str, urdf: str, packages: Mapping[str, str]) -> Path:
    """Where a mesh lies that a URDF names: in one of the robot's packages or beside the URDF.

    Args:
        filename: `package://NAME/PATH`, or a path from the URDF's folder.
        urdf: path of the URDF.
        packages: folder of each package.

    Raises:
        FileError: it is none of these, leads out of its folder, also through a link, or is not
            there.
    """
    folder, rest = Path(urdf).parent, filename
    others = [Path(other) for other in packages.values()]
    if filename.startswith(PACKAGE):
        package, _, rest = filename.removeprefix(PACKAGE).partition("/")
        if package not in packages:
            known = ", ".join(packages) or "it has none"
            raise FileError(
                f"{filename!r:.200} refers to unknown package {package!r:.80} (packages: {known})"
            )
        folder = Path(packages[package])
    if not rest or "://" in rest or Path(rest).is_absolute():
        raise FileError(
            f"{filename!r:.200} is no path of a package; write package://NAME/PATH, or a path from "
            "the folder of the URDF"
        )
    try:
        path = (folder / rest).resolve()
        roots = [root.resolve() for root in (folder, *others)]
        there = path.exists()
    except (OSError, ValueError, RuntimeError) as error:  # a name too long, links in a circle
        raise FileError(f"{filename!r:.200} is no path: {error}") from None
    if not any(path.is_relative_to(root) for root in roots):
        raise FileError(
            f"{filename!r:.200} leads to {path}, out of the robot's folders; put the file beside "
            "the URDF or into one of its packages"
        )
    if not there:
        raise FileError(f"{filename!r:.200} refers to {path}, which does not exist")
    return path


def check_mesh(path: Path) -> None:
    """Raise `FileError` unless a file is an STL or OBJ mesh of finite coordinates."""
    ending = path.suffix.lower()
    if ending not in (".stl", ".obj"):
        raise FileError(f"{path} is no mesh that every engine reads; give an .stl or .obj file")
    data = read_file(path, LARGEST_MESH, "the mesh")
    points = _stl_points(data) if ending == ".stl" else _obj_points(data)
    if points is None or len(points) < 3:
        raise FileError(f"{path} holds no {ending[1:].upper()} mesh")
    if not (np.abs(points) <= FARTHEST).all():  # false for NaN
        raise FileError(f"{path} has a vertex that is not finite, or more than {FARTHEST:g} away")


TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
"""One of a binary STL, after 80 bytes of header and the number of triangles (uint32)."""


def _stl_points(data: bytes) -> np.ndarray | None:
    """Corners of the triangles, (n, 3); None for what is no STL."""
    if len(data) >= 84:
        count = int.from_bytes(data[80:84], "little")
        if len(data) == 84 + count * TRIANGLE.itemsize:
            return np.frombuffer(data, TRIANGLE, offset=84)["corners"].reshape(-1, 3)
    if not data.lstrip().lower().startswith(b"solid"):
        return None
    return _vertices(data, b"vertex")


def _obj_points(data: bytes) -> np.ndarray | None:
    """Vertices, (n, 3); None for what is no OBJ with faces."""
    has_faces = any(line.split()[:1] == [b"f"] for line in data.splitlines())
    return _vertices(data, b"v") if has_faces else None


def _vertices(data: bytes, word: bytes) -> np.ndarray | None:
    rows = [line.split()[1:4] for line in data.splitlines() if line.split()[:1] == [word]]
    try:
        return np.array([[float(part) for part in row] for row in rows]).reshape(-1, 3)
    except ValueError:
        return None
