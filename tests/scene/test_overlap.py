"""How deep boxes overlap, against closed forms and an independent test of whether they do."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.optimize import linprog

from pytest_simbench.scene import Box, Pose, penetration
from pytest_simbench.scene.overlap import overlaps, rotations

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
