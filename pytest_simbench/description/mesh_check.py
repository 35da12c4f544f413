"""Meshes that a robot description names: files of the robot, not of the system, and binary STL, the
one form in which robots have meshes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from pytest_simbench.ground.files import FileError, read_file
from pytest_simbench.scene import FloatArray

LARGEST_MESH = 16 * 2**20
"""[bytes]"""

MOST_TRIANGLES = 200_000
"""The least that an engine takes of an STL (docs/decisions.md)."""

FARTHEST = 50.0
"""No vertex is farther from its origin [m]: a link in millimetres would be."""

THINNEST = 1e-6
"""Extent in the shortest direction over that in the longest."""

PACKAGE = "package://"

HEADER = 84
"""[bytes]: 80, and the number of triangles (uint32)."""

TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
"""One record a triangle after that."""


def read_stl(data: bytes) -> FloatArray:
    """The corners of the triangles, (n, 3, 3); none where the data are something else."""
    count = int.from_bytes(data[HEADER - 4 : HEADER], "little")
    if len(data) != HEADER + count * TRIANGLE.itemsize:
        return np.empty((0, 3, 3))
    return np.asarray(np.frombuffer(data, TRIANGLE, count, HEADER)["corners"], dtype=float)


def written_stl(corners: ArrayLike, normals: ArrayLike = 0.0) -> bytes:
    """A file of triangles: their corners, (n, 3, 3), counter-clockwise from outside, and normals,
    (n, 3)."""
    triangles = np.zeros(len(np.asarray(corners)), TRIANGLE)
    triangles["corners"], triangles["normal"] = corners, normals
    return bytes(HEADER - 4) + np.uint32(len(triangles)).tobytes() + triangles.tobytes()


def mesh_path(filename: str, urdf: str, packages: Mapping[str, str]) -> Path:
    """Where a mesh lies that a URDF names: in one of the robot's packages or beside the URDF.

    Args:
        filename: `package://NAME/PATH`, or a path from the URDF's folder.

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
    """Raise `FileError` unless a file is a binary STL mesh that has a convex hull."""
    if path.suffix.lower() != ".stl":
        raise FileError(f"{path} is no mesh that every engine reads; give a binary .stl file")
    triangles = read_stl(read_file(path, LARGEST_MESH, "the mesh"))
    if not (count := len(triangles)):
        raise FileError(f"{path} holds no binary STL mesh; write it anew from a mesh editor")
    if count > MOST_TRIANGLES:
        raise FileError(f"{path} has {count} triangles; simplify it to {MOST_TRIANGLES} or fewer")
    points = triangles.reshape(-1, 3)
    if not (np.abs(points) <= FARTHEST).all():  # false for NaN
        raise FileError(
            f"{path} has a vertex that is not finite, or more than {FARTHEST:g} m away; if it is "
            "in millimetres, scale it to metres"
        )
    spread = np.linalg.eigvalsh(np.cov(points.T))
    if not spread[0] > THINNEST**2 * spread[2]:
        raise FileError(f"{path} is flat: it has no convex hull, which is what engines collide")
