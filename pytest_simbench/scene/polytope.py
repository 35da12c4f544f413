"""Convex polytopes: the faces between some corners, and the inertia of what fills them evenly."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.scene.checks import SceneError
from pytest_simbench.scene.pose import (
    FloatArray,
    Pose,
    Vector3,
    principal_axes,
    quaternion_of,
    vector3,
)

MOST = 64
"""Corners of a mesh, as many as the engine that takes fewest does, of hulls for a GPU."""

EVEN = 1e-6
"""Share of its size by which a mesh's corners, centre and axes may be off: single precision has 7
digits, and files of meshes are written with it."""


class Polytope:
    """The convex hull of points.

    Attributes:
        points: as given, (n, 3) [m].
        faces: numbers of the points around each face, counter-clockwise from outside.

    Raises:
        SceneError: they lie in a plane, or are not 4 to `MOST` finite points.
    """

    def __init__(self, points: Sequence[Vector3] | FloatArray) -> None:
        self.points: FloatArray = np.array(points, dtype=float)
        if self.points.ndim != 2 or self.points.shape[1:] != (3,):
            raise SceneError("the corners of a mesh are rows of 3 numbers [m]")
        if not 4 <= len(self.points) <= MOST or not np.isfinite(self.points).all():
            raise SceneError(f"a mesh has 4 to {MOST} corners, and none at infinity")
        self.size = float(np.ptp(self.points, axis=0).max())
        self.normals, self.faces = self._faces()

    def _faces(self) -> tuple[FloatArray, list[list[int]]]:
        """Outward normals (m, 3) and the corners of each face: of all planes through three points
        those with no point beyond. A few dozen points make some ten thousand planes."""
        points, close = self.points - self.points.mean(axis=0), EVEN * self.size
        a, b, c = (points[list(k)] for k in zip(*combinations(range(len(points)), 3), strict=True))
        normals = np.cross(b - a, c - a)
        areas = np.linalg.norm(normals, axis=1)
        wide = areas > EVEN * self.size**2
        normals = normals[wide] / areas[wide, None]
        away = normals @ points.T - np.einsum("ni,ni->n", normals, a[wide])[:, None]
        low, high = away.min(axis=1, initial=0.0), away.max(axis=1, initial=0.0)
        sides = np.where(high <= close, 1.0, -1.0)
        bounding = ((high <= close) | (low >= -close)) & (high - low > 2 * close)
        if not bounding.any():
            raise SceneError("the corners of a mesh lie in one plane; it has no volume")
        found: dict[bytes, int] = {}
        for k in np.flatnonzero(bounding)[np.argsort(-areas[wide][bounding], kind="stable")]:
            found.setdefault((np.abs(away[k]) <= close).tobytes(), int(k))  # of the widest three
        members = {key: np.frombuffer(key, dtype=bool) for key in found}
        whole = [  # corners that are nearly in line make planes of a part of a face
            key
            for key, own in members.items()
            if not any((own <= other).all() for name, other in members.items() if name != key)
        ]
        outward = np.array([sides[found[key]] * normals[found[key]] for key in whole])
        rings = [
            _around(points, np.flatnonzero(members[key]), normal)
            for key, normal in zip(whole, outward, strict=True)
        ]
        return outward, rings

    @cached_property
    def corners(self) -> list[int]:
        """Numbers of the points that are corners: faces of three directions meet there."""
        meeting = [
            [k for k, face in enumerate(self.faces) if i in face] for i in range(len(self.points))
        ]
        return [
            i
            for i, faces in enumerate(meeting)
            if len(faces) > 2 and np.linalg.matrix_rank(self.normals[faces], tol=EVEN) == 3
        ]

    @cached_property
    def edges(self) -> FloatArray:
        """Directions of its edges, each once, unit vectors (n, 3)."""
        rings = [zip(face, [*face[1:], face[0]], strict=True) for face in self.faces]
        pairs = sorted({(min(pair), max(pair)) for ring in rings for pair in ring})
        ways = np.array([self.points[b] - self.points[a] for a, b in pairs])
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        kept: list[FloatArray] = []
        for way in ways:
            if not any(abs(abs(float(way @ other)) - 1) < EVEN**2 for other in kept):
                kept.append(way)
        return np.array(kept)

    @cached_property
    def triangles(self) -> list[tuple[int, int, int]]:
        """Numbers of the corners of each, counter-clockwise from outside; together its surface."""
        return [(f[0], f[k], f[k + 1]) for f in self.faces for k in range(1, len(f) - 1)]

    @cached_property
    def _parts(self) -> tuple[FloatArray, FloatArray]:
        """Volumes (n,) of the tetrahedra of the triangles with the first point, and their corners
        (n, 3, 3) from there; all sums are over these."""
        spans = (self.points - self.points[0])[np.array(self.triangles)]
        return np.linalg.det(spans) / 6, spans

    @cached_property
    def volume(self) -> float:
        """[m^3]."""
        return float(self._parts[0].sum())

    @cached_property
    def centroid(self) -> FloatArray:
        """Centre of its volume [m], (3,)."""
        volumes, spans = self._parts
        return np.asarray(self.points[0] + volumes @ spans.sum(axis=1) / 4 / self.volume)

    @cached_property
    def inertia(self) -> FloatArray:
        """Tensor of inertia about its centroid for a mass of 1 kg, spread evenly, (3, 3) [m^2].

        Of a tetrahedron with corners 0, a, b, c the integral of x x^T is V / 20 times the sum of
        the squares of a, b, c and of their sum (Tonon, Explicit exact formulas for the 3-D
        tetrahedron inertia tensor, J. Math. Stat. 1 (2005) 8)."""
        volumes, spans = self._parts
        whole = spans.sum(axis=1)
        squares = np.einsum("nki,nkj->nij", spans, spans) + np.einsum("ni,nj->nij", whole, whole)
        about = self.centroid - self.points[0]
        second = np.einsum("n,nij->ij", volumes, squares) / 20 / self.volume
        second -= np.outer(about, about)
        return np.asarray(np.trace(second) * np.eye(3) - second)

    @property
    def aligned(self) -> bool:
        """Whether its principal axes of inertia are those of its frame."""
        aside = self.inertia - np.diag(np.diag(self.inertia))
        return bool(np.abs(aside).max() <= EVEN * np.trace(self.inertia))


def _around(points: FloatArray, members: NDArray[np.intp], normal: FloatArray) -> list[int]:
    """Points of a plane, in the order in which they surround their middle."""
    spans = points[members] - points[members].mean(axis=0)
    first = spans[int(np.argmax(np.linalg.norm(spans, axis=1)))]
    angles = np.arctan2(spans @ np.cross(normal, first), spans @ first)
    found: list[int] = members[np.argsort(angles)].tolist()
    return found


@lru_cache(maxsize=256)
def polytope(points: tuple[Vector3, ...]) -> Polytope:
    """The hull of these points, made once."""
    return Polytope(points)


def principal(points: Sequence[Sequence[float]] | FloatArray) -> tuple[tuple[Vector3, ...], Pose]:
    """The corners of the convex hull of 4 to `MOST` points in any frame, (n, 3) [m], in the frame
    that a `ConvexMesh` must have: its origin is the hull's centroid, and its axes are the principal
    axes of inertia.

        vertices, frame = principal(points)
        rock = ConvexMesh("rock", vertices, pose * frame, mass=1.0)

    Returns:
        The corners, and the pose of their frame in that of the points. Axes that are principal ones
        stay as they are.

    Raises:
        SceneError: the points lie in a plane, or are none.
    """
    found = Polytope(np.array(points, dtype=float))
    found = Polytope(found.points[found.corners])
    turn = np.eye(3)
    if not found.aligned:
        turn = principal_axes(found.inertia)[1]
    vertices = tuple(vector3(row) for row in (found.points - found.centroid) @ turn)
    return vertices, Pose.from_array([*found.centroid, *quaternion_of(turn)])
