"""Reaches tell shapes apart, and meshes are read from binary STL and OBJ files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pytest_simbench.description.mesh_check import written_stl
from pytest_simbench.description.shapes import (
    DIRECTIONS,
    a_box,
    a_cylinder,
    a_mesh,
    a_round,
    box_corners,
    capsule_hull,
    cylinder_hull,
    mesh_points,
    outlines,
    placed,
    reach,
    write_obj,
)
from pytest_simbench.scene import Polytope, Pose
from pytest_simbench.simulator import DescriptionError

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 3]], dtype=float)


def test_reach_of_a_box() -> None:
    reaches = dict(zip(map(tuple, DIRECTIONS.round(3)), reach(box_corners((2, 4, 6))), strict=True))
    assert reaches[(1, 0, 0)] == 1
    assert reaches[(0, 0, -1)] == 3
    assert reaches[(0.577, 0.577, 0.577)] == pytest.approx(6 / np.sqrt(3))


def stl_binary() -> bytes:
    floats = np.zeros(12, "<f4")
    floats[3:] = TRIANGLE.ravel()
    return bytes(80) + (1).to_bytes(4, "little") + floats.tobytes() + bytes(2)


def obj_text() -> bytes:
    corners = "\n".join(f"v {x} {y} {z} 1.0" for x, y, z in TRIANGLE)
    return f"# t\n{corners}\nvn 0 0 1\nf 1 2 3\n".encode()


MANY = ("a.stl", written_stl([TRIANGLE] * 300))


@pytest.mark.parametrize(("name", "data"), [MANY, ("b.STL", stl_binary()), ("c.obj", obj_text())])
def test_meshes_are_read(tmp_path: Path, name: str, data: bytes) -> None:
    (tmp_path / name).write_bytes(data)
    points = mesh_points(str(tmp_path / name))
    assert points.dtype == np.float64
    np.testing.assert_array_equal(points, TRIANGLE[np.lexsort(TRIANGLE.T[::-1])])


def test_the_corners_of_a_box() -> None:
    corners = {tuple(c) for c in box_corners((2, 4, 6))}
    assert corners == {(x, y, z) for x in (-1, 1) for y in (-2, 2) for z in (-3, 3)}


def test_a_frame_is_turned_and_then_moved() -> None:
    there = placed(np.array([[1.0, 2.0, 3.0]]), Pose.at(10, 20, 30, yaw=np.pi / 2))
    np.testing.assert_allclose(there, [[8, 21, 33]])


def test_reach_of_what_is_round() -> None:
    """A sphere, and a tilted and moved cylinder and capsule by points on their rims."""
    np.testing.assert_allclose(a_round(0.3)[1], np.full(26, 0.3))
    pose = Pose((0.1, -0.2, 0.3), (0.5, 0.5, -0.1, 0.7))
    angles = np.linspace(0, 2 * np.pi, 20000)
    rim = np.stack([0.3 * np.cos(angles), 0.3 * np.sin(angles), 0.4 + 0 * angles], axis=1)
    rims = placed(np.vstack([rim, rim * (1, 1, -1)]), pose)
    kind, reached = a_cylinder(0.3, 0.8, pose)
    assert kind == a_round(0.3)[0] == "rounds"
    np.testing.assert_allclose(reached, reach(rims), atol=1e-6)
    ends = placed(np.array([[0, 0, 0.4], [0, 0, -0.4]]), pose)
    np.testing.assert_allclose(a_round(0.3, 0.8, pose)[1], reach(ends) + 0.3)


def test_reach_of_what_has_corners() -> None:
    pose = Pose((0.1, -0.2, 0.3), (0.5, 0.5, -0.1, 0.7))
    corners = box_corners((0.2, 0.4, 0.6))
    told = dict([a_box((0.2, 0.4, 0.6), pose), a_mesh(corners, pose)])
    assert list(told) == ["boxes", "meshes"]
    for reached in told.values():
        np.testing.assert_allclose(reached, reach(corners @ pose.rotation().T + pose.position))


@pytest.mark.parametrize("half", [0.0, 0.5])
def test_hulls_of_round_shapes_have_their_corners_on_them(half: float) -> None:
    """And are smaller by what is told at most."""
    ways = np.random.default_rng(0).normal(size=(20_000, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    corners, gap = capsule_hull(0.2, half)
    axis = np.clip(corners[:, 2:], -half, half) * (0.0, 0.0, 1.0)
    np.testing.assert_allclose(np.linalg.norm(corners - axis, axis=1), 0.2)
    short = 0.2 + half * np.abs(ways[:, 2]) - (ways @ corners.T).max(axis=1)
    assert 0.95 * gap < short.max() <= gap < 0.1 * 0.2
    corners, gap = cylinder_hull(0.2, 0.5)
    np.testing.assert_allclose(np.hypot(*corners.T[:2]), 0.2)
    assert sorted(corners[:, 2]) == [-0.5] * 32 + [0.5] * 32
    flat = ways[:, :2] / np.linalg.norm(ways[:, :2], axis=1, keepdims=True)
    assert 0.2 - (flat @ corners[:, :2].T).max(axis=1).min() == pytest.approx(gap, rel=1e-3)


def test_a_hull_is_written_as_text(tmp_path: Path) -> None:
    hull = Polytope([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.0, 0.0, 3.0)])
    path = write_obj(tmp_path / "a.obj", hull)
    np.testing.assert_array_equal(mesh_points(str(path)), np.unique(hull.points, axis=0))
    sides = [line.split() for line in path.read_text().splitlines() if line.startswith("f ")]
    assert [tuple(int(k) - 1 for k in side[1:]) for side in sides] == [*map(tuple, hull.triangles)]


def test_order_is_by_what_tells_symmetric_shapes_apart() -> None:
    """All orders of six boxes that mirror each other give the same rows."""
    places = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    rows = [reach(placed(box_corners((1, 1, 1)), Pose.at(*place))) for place in places]
    meshes = [("meshes", row) for row in rows[:2]]
    wanted = outlines([*(("boxes", row) for row in rows), *meshes])
    assert set(wanted) == {"boxes", "meshes", "rounds"}
    assert {row.tobytes() for row in wanted["boxes"]} == {row.tobytes() for row in rows}
    for seed in range(10):
        order = np.random.default_rng(seed).permutation(6)
        found = outlines([*(("boxes", rows[k]) for k in order), *meshes[::-1]])
        for name, value in wanted.items():
            np.testing.assert_array_equal(found[name], value)


def test_directions_are_unit_vectors_to_faces_edges_and_corners() -> None:
    assert DIRECTIONS.shape == (26, 3)
    np.testing.assert_allclose(np.linalg.norm(DIRECTIONS, axis=1), 1.0)
    assert len(np.unique(DIRECTIONS.round(6), axis=0)) == 26


@pytest.mark.parametrize(
    ("name", "data"),
    [("a.stl", b"no mesh"), ("b.stl", b"solid empty"), ("c.dae", b"<xml/>"), ("d.obj", b"v 1 x 2")],
)
def test_what_is_no_mesh_is_refused(tmp_path: Path, name: str, data: bytes) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(DescriptionError, match=f"{name} is no STL or OBJ file"):
        mesh_points(str(tmp_path / name))


def test_a_changed_file_is_read_anew(tmp_path: Path) -> None:
    import os

    path = tmp_path / "mesh.obj"
    path.write_bytes(obj_text())
    first = mesh_points(str(path))
    path.write_bytes(obj_text().replace(b"v 1.0", b"v 5.0"))
    os.utime(path, ns=(1, 1))
    assert mesh_points(str(path)).max() > first.max()
