"""Finely drawn meshes as the convex bodies that engines make of them, with few corners.

Every engine collides the convex hull of a mesh. CAD parts of tens of thousands of triangles have
hulls of thousands of corners, which take an engine seconds to build and gain nothing.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull

from pytest_simbench.scene import FloatArray
from pytest_simbench.simulator.mesh_check import TRIANGLE
from pytest_simbench.simulator.robot_files import digest


def with_hulls(kept: dict[str, Any], corners: int) -> dict[str, Any]:
    """A description's content (`robot_files.content`) with hulls for its meshes.

    Args:
        kept: the content.
        corners: of each hull at most.
    """
    urdf, meshes, names = ET.fromstring(kept["urdf"]), {}, {}
    for name, data in kept["meshes"].items():
        points = np.frombuffer(data, TRIANGLE, offset=84)["corners"].reshape(-1, 3).astype(float)
        points = points[ConvexHull(points).vertices]
        hull = stl(points[extreme(points, corners)])
        names[name] = f"{digest(hull)}.stl"
        meshes[names[name]] = hull
    for mesh in urdf.iter("mesh"):
        mesh.set("filename", names[mesh.get("filename", "")])
    return {"urdf": ET.tostring(urdf, encoding="unicode"), "meshes": meshes}


def extreme(points: FloatArray, count: int) -> FloatArray:
    """Which points, (n, 3), lie farthest out in so many directions, evenly spread; each once.

    Their hull lies in that of all points. On a ball of radius r it stands back by some 4 r / count.
    """
    height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)  # a Fibonacci lattice
    flat = np.sqrt(1.0 - height**2)
    directions = np.stack([flat * np.cos(turn), flat * np.sin(turn), height])
    return np.unique(np.argmax(points @ directions, axis=0))


def stl(points: FloatArray) -> bytes:
    """The convex hull of points, (n, 3), as a binary STL, its faces turned outwards."""
    hull = ConvexHull(points)
    triangles = np.zeros(len(hull.simplices), TRIANGLE)
    corners = hull.points[hull.simplices]
    normals = hull.equations[:, :3]
    a, b, c = corners.transpose(1, 0, 2)
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), normals) < 0
    corners[inwards] = corners[inwards][:, ::-1]
    triangles["corners"], triangles["normal"] = corners, normals
    return bytes(80) + np.uint32(len(triangles)).tobytes() + triangles.tobytes()
