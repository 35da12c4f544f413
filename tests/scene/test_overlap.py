"""How deep boxes overlap; faces and inertia of convex polytopes."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from pytest_simbench.scene import (
    Box,
    FloatArray,
    Polytope,
    Pose,
    SceneError,
    penetration,
    principal,
)
from pytest_simbench.scene.overlap import overlaps, rotated, rotations
from pytest_simbench.scene.polytope import MOST

numbers = st.floats(-1.0, 1.0)
quaternions = st.tuples(numbers, numbers, numbers, numbers).filter(
    lambda q: np.linalg.norm(q) > 0.1
)
edges = st.floats(0.1, 1.0)


@st.composite
def boxes(draw: st.DrawFn) -> Box:
    q = np.array(draw(quaternions))
    w, x, y, z = (float(value) for value in q / np.linalg.norm(q))
    at = draw(st.tuples(numbers, numbers, numbers))
    return Box("it", draw(st.tuples(edges, edges, edges)), Pose(at, (w, x, y, z)), mass=1.0)


def share_a_point(a: Box, b: Box) -> bool:
    """Linear programming: is there a point within the six faces of both?"""
    rows, bounds = [], []
    for box in (a, b):
        turn, half = box.pose.rotation(), np.array(box.size) / 2
        centre = turn.T @ np.array(box.pose.position)
        rows += [turn.T, -turn.T]
        bounds += [centre + half, half - centre]
    found = linprog(np.zeros(3), np.vstack(rows), np.concatenate(bounds), bounds=[(None, None)] * 3)
    return bool(found.status == 0)


@given(boxes(), boxes())
def test_boxes_overlap_where_they_share_a_point(a: Box, b: Box) -> None:
    depth = penetration(a, b)
    assume(abs(depth) > 1e-6)
    assert (depth > 0) == share_a_point(a, b)


@given(boxes(), boxes())
def test_the_depth_is_how_far_they_must_be_moved_apart(a: Box, b: Box) -> None:
    """No shorter way separates them, tried along many directions; and moved together as one, or
    named the other way round, they overlap as much."""
    depth = penetration(a, b)
    assert penetration(b, a) == pytest.approx(depth, abs=1e-9)
    move = Pose.at(0.3, -0.2, 0.1, yaw=0.7)
    together = [box.moved_to(move * box.pose) for box in (a, b)]
    assert penetration(*together) == pytest.approx(depth, abs=1e-9)
    if depth <= 1e-3:
        return
    directions = np.random.default_rng(1).normal(size=(30, 3))
    for direction in directions / np.linalg.norm(directions, axis=1, keepdims=True):
        less = Pose(tuple(np.add(b.pose.position, 0.99 * depth * direction)), b.pose.quaternion)
        assert penetration(a, b.moved_to(less)) > 0


@pytest.mark.parametrize(
    ("pose", "depth"),
    [
        (Pose.at(0.3, 0.0, 0.0), 0.7),
        (Pose.at(0.9, 0.8, -0.7), 0.1),
        (Pose.at(0.0, 0.0, 0.0), 1.0),
        (Pose.at(1.1, 0.0, 0.0, yaw=math.pi / 4), 0.5 + math.sqrt(0.5) - 1.1),
        (Pose((0.0, 0.0, 1.2), (math.cos(math.pi / 8), math.sin(math.pi / 8), 0.0, 0.0)),
         0.5 + math.sqrt(0.5) - 1.2),
        (Pose.at(1.3, 0.0, 0.0), -0.3),
    ],
)  # fmt: skip
def test_closed_forms(pose: Pose, depth: float) -> None:
    unit = Box("unit", (1.0, 1.0, 1.0), Pose())
    assert penetration(unit, unit.moved_to(pose)) == pytest.approx(depth)


def test_edge_to_edge_only_a_product_of_edges_separates() -> None:
    """Two crossed bars, each on its edge: no face of either separates them."""
    eighth = math.pi / 8
    one = Box("one", (2.0, 0.2, 0.2), Pose((0, 0, 0), (math.cos(eighth), math.sin(eighth), 0, 0)))
    other = Box(
        "other", (0.2, 2.0, 0.2), Pose((0, 0, 0), (math.cos(eighth), 0, math.sin(eighth), 0))
    )
    gap = 0.01
    height = 0.2 * math.sqrt(2) + gap
    assert penetration(one, other.moved_to(Pose((0, 0, height), other.pose.quaternion))) == (
        pytest.approx(-gap)
    )


@given(st.lists(st.tuples(boxes(), boxes()), min_size=1, max_size=5))
def test_many_pairs_at_once_are_as_each_by_itself(pairs: list[tuple[Box, Box]]) -> None:
    def stacked(which: int, what: str) -> np.ndarray:
        values = {"turn": lambda b: b.pose.rotation(), "half": lambda b: np.array(b.size) / 2}
        return np.array([values[what](pair[which]) for pair in pairs])

    offset = np.array([np.subtract(b.pose.position, a.pose.position) for a, b in pairs])
    found = overlaps(
        offset, stacked(0, "turn"), stacked(0, "half"), stacked(1, "turn"), stacked(1, "half")
    )
    for depth, (a, b) in zip(found, pairs, strict=True):
        alone = penetration(a, b)
        assert alone == pytest.approx(depth) or alone == 0.0 > depth  # far apart


@given(st.lists(quaternions, min_size=1, max_size=5))
def test_rotations_are_those_of_poses(found: list[tuple[float, float, float, float]]) -> None:
    expected = [Pose(quaternion=q).rotation() for q in found]
    assert rotations(np.array(found)) == pytest.approx(np.array(expected))
    unit = np.array([Pose(quaternion=q).quaternion for q in found])
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    vectors = np.arange(3.0 * len(found)).reshape(-1, 3)
    turned = [turn @ vector for turn, vector in zip(expected, vectors, strict=True)]
    assert rotated(unit, vectors) == pytest.approx(np.array(turned))


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
    assert found.size == pytest.approx(SIZE.max())
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


def test_principal_finds_frame_and_corners() -> None:
    """A turned box, and points in it, on a face and an edge: its corners come back in its own
    frame, and the frame says where they were."""
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    turn[:, 0] *= np.linalg.det(turn)
    points = np.vstack([CUBE, 0.3 * CUBE, [[0.5, 0.0, 0.0], [0.5, 0.5, 0.2]]]) * SIZE @ turn.T
    points += [0.4, -2.0, 1.0]
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
