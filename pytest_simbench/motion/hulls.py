"""Finely drawn meshes as the convex bodies that engines make of them, with few corners.

Every engine collides the convex hull of a mesh. CAD parts of tens of thousands of triangles have
hulls of thousands of corners, which take an engine seconds to build and gain nothing. A part that
is not convex, such as a jaw with a stepped face, may be cut into slices first, each with a hull of
its own.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from copy import deepcopy
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from pytest_simbench.description.mesh_check import read_stl, written_stl
from pytest_simbench.description.robot_files import digest
from pytest_simbench.description.shapes import directions
from pytest_simbench.description.urdf import origin_of
from pytest_simbench.scene import FloatArray

AXES = ("x", "y", "z")

THINNEST = 1e-4
"""A slice of a mesh that is flatter than this, along the cut axis, is left out [m]: what a plane
cuts off by rounding."""


class Cuts(NamedTuple):
    """Planes that cut the meshes of a link: across which of its axes, and where [m]."""

    axis: str
    at: tuple[float, ...]


def with_hulls(
    kept: dict[str, Any], corners: int, cuts: Mapping[str, Cuts] | None = None
) -> dict[str, Any]:
    """A description's content (`robot_files.content`) with hulls of at most so many corners for its
    meshes, those of some links, by name, cut into slices before."""
    urdf, meshes = ET.fromstring(kept["urdf"]), {}
    for link in urdf.iter("link"):
        cut = (cuts or {}).get(link.get("name", ""))
        for collision in link.findall("collision"):
            mesh = collision.find("geometry/mesh")
            if mesh is None:
                continue
            at = list(link).index(collision)
            link.remove(collision)
            triangles = read_stl(kept["meshes"][mesh.attrib["filename"]])
            for points in _slices(triangles, collision, cut):
                points = points[ConvexHull(points).vertices]
                hull = stl(points[extreme(points, corners)])
                name = f"{digest(hull)}.stl"
                meshes[name] = hull
                part = deepcopy(collision)
                part.find("geometry/mesh").set("filename", name)  # type: ignore[union-attr]
                link.insert(at, part)
                at += 1
    return {"urdf": ET.tostring(urdf, encoding="unicode"), "meshes": meshes}


def _slices(triangles: FloatArray, collision: ET.Element, cut: Cuts | None) -> Iterator[FloatArray]:
    """The points of each slice of a link's mesh, in the mesh's own frame, (n, 3) each."""
    points = triangles.reshape(-1, 3)
    if cut is None:
        yield points
        return
    frame = origin_of(collision)
    axis = AXES.index(cut.axis)
    height = points @ frame.rotation()[axis] + frame.position[axis]
    edges = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    ends = edges @ frame.rotation()[axis] + frame.position[axis]
    for low, high in pairwise((-np.inf, *sorted(cut.at), np.inf)):
        inside = (height >= low) & (height <= high)
        parts = [points[inside], *(_crossings(edges, ends, plane) for plane in (low, high))]
        found = np.concatenate(parts)
        along = found @ frame.rotation()[axis]
        if len(found) and np.ptp(along) > THINNEST:
            yield found


def _crossings(edges: FloatArray, heights: FloatArray, plane: float) -> FloatArray:
    """Where edges, (n, 2, 3), with ends at some heights, (n, 2), cross a plane, (m, 3)."""
    crossing = (heights.min(axis=1) < plane) & (plane < heights.max(axis=1))
    (a, b), (low, high) = edges[crossing].transpose(1, 0, 2), heights[crossing].T
    share = ((plane - low) / (high - low))[:, None]
    return np.asarray(a + share * (b - a))


def extreme(points: FloatArray, count: int) -> FloatArray:
    """Which points, (n, 3), lie farthest out in so many directions, evenly spread; each once.

    Their hull lies in that of all points. On a ball of radius r it stands back by some 4 r / count.
    """
    return np.unique(np.argmax(points @ directions(count).T, axis=0))


def stl(points: FloatArray) -> bytes:
    """The convex hull of points, (n, 3), as a binary STL, its faces turned outwards."""
    hull = ConvexHull(points)
    return written_stl(hull.points[outward_faces(hull)], hull.equations[:, :3])


def outward_faces(hull: ConvexHull) -> NDArray[np.intp]:
    """Numbers of the points of its triangles, counter-clockwise from outside, (n, 3)."""
    faces = np.array(hull.simplices, dtype=int)
    a, b, c = hull.points[faces].transpose(1, 0, 2)
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    faces[inwards] = faces[inwards][:, ::-1]
    return faces
