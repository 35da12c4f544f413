"""What a collision shape is compared by: how far it reaches, and the files that meshes come from.

An engine may keep a box as a box, a mesh as its convex hull or as triangles, and number the shapes
of a link as it likes. How far each reaches in 26 directions (its support function) is the same.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import product
from pathlib import Path

import numpy as np

from pytest_simbench.description.mesh_check import read_stl, written_stl
from pytest_simbench.description.urdf import Shape
from pytest_simbench.ground.errors import DescriptionError
from pytest_simbench.scene import FloatArray, Polytope, Pose
from pytest_simbench.scene.overlap import box_corners
from pytest_simbench.scene.polytope import MOST

_GRID = np.array([d for d in product((-1.0, 0.0, 1.0), repeat=3) if any(d)])
DIRECTIONS: FloatArray = _GRID / np.linalg.norm(_GRID, axis=1, keepdims=True)
"""The 26 directions to faces, edges and corners of a cube, unit vectors, (26, 3)."""

NO_REACH: FloatArray = np.full(len(DIRECTIONS), np.nan)
"""Of what an engine has and no scene, (26,)."""

OUTLINES = ("boxes", "meshes", "rounds")
"""The quantities of a body or link that `outlines` makes."""

_ORDER = np.sqrt(np.arange(2.0, 28.0))
"""Weights of the directions that put shapes in an order of their own; roots, so that no
symmetry makes two different shapes equal."""


def reach(points: FloatArray) -> FloatArray:
    """How far points (n, 3) reach in each of `DIRECTIONS` from the frame's origin [m], (26,)."""
    return np.asarray((points @ DIRECTIONS.T).max(axis=0))


Outline = tuple[str, FloatArray]
"""Of a collision shape its kind, one of `OUTLINES`, and its `reach`."""


def a_round(radius: float, length: float = 0.0, pose: Pose | None = None) -> Outline:
    """A sphere, or a capsule along the z axis of a pose.

    Args:
        radius: [m].
        length: of the capsule's cylindrical part [m].
        pose: of its centre in the frame; by default the frame itself.
    """
    pose = pose or Pose()
    along: FloatArray = np.abs(DIRECTIONS @ pose.rotation()[:, 2]) * length / 2
    return "rounds", np.asarray(DIRECTIONS @ np.asarray(pose.position) + along + radius)


def a_cylinder(radius: float, length: float, pose: Pose) -> Outline:
    """A cylinder along the z axis of a pose; arguments as of `a_round`."""
    along = DIRECTIONS @ pose.rotation()[:, 2]
    across = np.sqrt(np.maximum(0.0, 1.0 - along**2))
    reached = np.abs(along) * length / 2 + across * radius
    return "rounds", np.asarray(DIRECTIONS @ np.asarray(pose.position) + reached)


def a_box(size: Sequence[float] | FloatArray, pose: Pose) -> Outline:
    """A box of edge lengths `size` [m] whose centre is at a pose."""
    return "boxes", reach(placed(box_corners(size), pose))


def a_mesh(corners: FloatArray, pose: Pose) -> Outline:
    """A mesh by its corners in the frame at a pose, (n, 3) [m]."""
    return "meshes", reach(placed(corners, pose))


def outlines(
    shapes: Iterable[Outline], asked: Sequence[FloatArray] | None = None
) -> dict[str, FloatArray]:
    """The quantities `boxes`, `meshes` and `rounds` of a body or link.

    Args:
        asked: reaches of the same shapes to order them by, from whoever measures them with an error
            that may change the order.

    Returns:
        Of each kind the reaches in an order of their own, (n_shapes, 26) [m].
    """
    found, count = list(shapes), len(DIRECTIONS)
    reaches = [reached for _, reached in found]
    order = np.argsort(np.reshape(reaches if asked is None else asked, (-1, count)) @ _ORDER)
    return {
        kind: np.reshape([reaches[k] for k in order if found[k][0] == kind], (-1, count))
        for kind in OUTLINES
    }


def placed(points: FloatArray, pose: Pose) -> FloatArray:
    """Points (n, 3) given in the frame at `pose`."""
    return np.asarray(points @ pose.rotation().T + np.asarray(pose.position))


def shape_points(shape: Shape) -> FloatArray:
    """Corners of a box or a mesh (`mesh_corners`) in the frame of its link, (n, 3) [m]."""
    points = box_corners(shape.size) if shape.size else mesh_corners(shape.mesh or "")
    return placed(points, shape.pose)


def write_obj(path: Path, mesh: Polytope) -> Path:
    """Write a hull as an OBJ file, for engines that take meshes from files alone; the path."""
    corners = [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.points.tolist()]
    sides = [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.triangles]
    path.write_text("\n".join([*corners, *sides, ""]), encoding="utf-8")
    return path


def write_stl(path: Path, mesh: Polytope) -> Path:
    """Write a hull as a binary STL file; the path."""
    path.write_bytes(written_stl(mesh.points[np.array(mesh.triangles)]))
    return path


def mesh_points(path: str) -> FloatArray:
    """The distinct corners of a mesh, (n, 3) [m]; errors as `mesh_corners`."""
    return np.asarray(np.unique(mesh_corners(path), axis=0))


def mesh_corners(path: str) -> FloatArray:
    """The corners of a mesh, each as often as triangles have it, (n, 3) [m].

    Raises:
        DescriptionError: the file is neither binary STL nor OBJ.
    """
    return _read_corners(path, Path(path).stat().st_mtime_ns)


@lru_cache(maxsize=64)
def _read_corners(path: str, _changed: int) -> FloatArray:
    reader = {".stl": read_stl, ".obj": _read_obj}.get(Path(path).suffix.lower())
    points = np.empty(0) if reader is None else reader(Path(path).read_bytes())
    if not len(points):
        raise DescriptionError(f"{path} is no STL or OBJ file: collision meshes must be one")
    return points.reshape(-1, 3)


def _read_obj(data: bytes) -> FloatArray:
    lines = (line.split() for line in data.decode("utf-8", "replace").splitlines())
    try:
        rows = [[float(x) for x in line[1:4]] for line in lines if line and line[0] == "v"]
        return np.array(rows, dtype=float).reshape(-1, 3)
    except ValueError:
        return np.empty((0, 3))


def cylinder_hull(radius: float, half: float) -> tuple[FloatArray, float]:
    """Corners of a cylinder along z of that radius and half length [m], and by how much their hull
    is smaller at most [m]: of links every engine reads boxes and meshes alone."""
    angles = np.linspace(0, 2 * np.pi, MOST // 2, endpoint=False)
    ring = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    ends = [np.hstack([ring, np.full((len(ring), 1), z)]) for z in (-half, half)]
    return np.concatenate(ends), radius * (1 - float(np.cos(np.pi / len(ring))))


def capsule_hull(radius: float, half: float = 0.0) -> tuple[FloatArray, float]:
    """The same of a capsule, `half` the length between its ends' middles; 0: a sphere."""
    points, gap = _unit_capsule(half / radius)
    return radius * points, radius * gap


@lru_cache
def _unit_capsule(half: float) -> tuple[FloatArray, float]:
    ways = directions(MOST)
    points = ways + np.array([0.0, 0.0, half]) * np.sign(ways[:, 2:])
    hull = Polytope(points)  # farthest from the capsule across the middles of its faces
    away = (hull.normals * points[[face[0] for face in hull.faces]]).sum(axis=1)
    return points, float((1 + half * np.abs(hull.normals[:, 2]) - away).max())


def directions(count: int) -> FloatArray:
    """Unit vectors, spread evenly over all directions (a spiral), (count, 3)."""
    z = 1 - (2 * np.arange(count) + 1) / count
    angle, flat = np.pi * (3 - np.sqrt(5)) * np.arange(count), np.sqrt(1 - z**2)
    return np.stack([flat * np.cos(angle), flat * np.sin(angle), z], axis=1)
