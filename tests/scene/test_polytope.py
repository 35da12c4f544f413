"""Hulls of points: faces, volume and inertia, and the frame that a mesh needs."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from pytest_simbench.scene import FloatArray, Polytope, SceneError, principal
from pytest_simbench.scene.polytope import MOST

CUBE = np.array(list(product((-0.5, 0.5), repeat=3)))
SIZE = np.array([0.3, 0.5, 0.2])


def prism(sides: int, radius: float = 0.1, length: float = 0.3) -> FloatArray:
    angles = 2 * np.pi * np.arange(sides) / sides
    ring = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.array([[*corner, z] for z in (-length / 2, length / 2) for corner in ring])


def test_a_box_has_its_faces_volume_and_inertia() -> None:
    """Four points of a plane are one face; the moments are m (b^2 + c^2) / 12."""
    found = Polytope(CUBE * SIZE + [1.0, 2.0, 3.0])
    assert sorted(map(len, found.faces)) == [4] * 6
    assert len(found.triangles) == 12
    assert len(found.edges) == 3
    assert found.volume == pytest.approx(np.prod(SIZE))
    assert np.allclose(found.centroid, [1.0, 2.0, 3.0])
    squares = SIZE**2
    assert np.allclose(found.inertia, np.diag((squares.sum() - squares) / 12))


@pytest.mark.parametrize("sides", [3, 7, MOST // 2])
def test_a_prism_is_two_rings_and_its_sides(sides: int) -> None:
    """Every face is seen counter-clockwise from outside. Moments of a regular polygon (Beer and
    Johnston): r^2 (2 + cos(2 pi / n)) / 6 about its axis for a mass of 1."""
    found = Polytope(prism(sides))
    assert sorted(map(len, found.faces)) == sorted([4] * sides + [sides] * 2)
    for face, normal in zip(found.faces, found.normals, strict=True):
        a, b, c = found.points[face[:3]]
        assert np.cross(b - a, c - b) @ normal > 0
        assert a @ normal > 0
    assert found.inertia[2, 2] == pytest.approx(0.01 * (2 + math.cos(2 * math.pi / sides)) / 6)


def test_any_hull_is_that_of_qhull() -> None:
    rng = np.random.default_rng(0)
    for count in (4, 9, 30):
        points = rng.normal(size=(count, 3))
        found, known = Polytope(points), ConvexHull(points)
        assert found.volume == pytest.approx(known.volume)
        assert found.corners == sorted(known.vertices)
        edges = {frozenset(e) for f in found.faces for e in zip(f, [*f[1:], f[0]], strict=True)}
        assert len(known.vertices) - len(edges) + len(found.faces) == 2  # Euler
        inside = known.points[rng.integers(count, size=20)].mean(axis=0)
        assert ((found.normals @ inside) <= (found.normals @ points.T).max(axis=1)).all()


def test_what_lies_on_a_face_or_an_edge_is_no_corner() -> None:
    inner = [[0.0, 0.0, 0.0], [0.5, 0.1, 0.0], [0.5, 0.5, 0.2]]
    assert Polytope(np.vstack([CUBE, inner])).corners == list(range(8))


def test_principal_finds_frame_and_corners() -> None:
    """A turned box, and points on and in it: its corners come back in its own frame, and the frame
    says where they were."""
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    turn[:, 0] *= np.linalg.det(turn)
    points = np.vstack([CUBE, 0.3 * CUBE, [[0.5, 0.0, 0.0]]]) * SIZE @ turn.T + [0.4, -2.0, 1.0]
    vertices, frame = principal(points)
    assert len(vertices) == 8
    assert np.allclose(np.sort(np.ptp(vertices, axis=0)), np.sort(SIZE))
    back = np.array(vertices) @ frame.rotation().T + frame.position
    assert np.allclose(back, points[:8])
    assert np.allclose(principal(vertices)[0], vertices)  # and stays


@pytest.mark.parametrize(
    ("points", "told"),
    [
        (CUBE[:3], "4 to 64 corners"),
        (np.zeros((MOST + 1, 3)), "4 to 64 corners"),
        (CUBE * [1.0, 1.0, 0.0], "one plane"),
        (np.full((5, 3), 1.0), "one plane"),
        (np.where(CUBE > 0, np.nan, CUBE), "none at infinity"),
        (np.zeros((5, 2)), "rows of 3 numbers"),
    ],
)
def test_points_that_span_nothing(points: FloatArray, told: str) -> None:
    with pytest.raises(SceneError, match=told):
        principal(points)
