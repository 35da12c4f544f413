"""Reaches tell shapes apart, and meshes are read from STL (binary, text) and OBJ files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pytest_simbench.scene import Pose
from pytest_simbench.simulator import DescriptionError
from pytest_simbench.simulator.shapes import (
    DIRECTIONS,
    box_corners,
    mesh_points,
    outlines,
    placed,
    reach,
)

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 3]], dtype=float)


def test_reach_of_a_box() -> None:
    reaches = dict(zip(map(tuple, DIRECTIONS.round(3)), reach(box_corners((2, 4, 6))), strict=True))
    assert reaches[(1, 0, 0)] == 1
    assert reaches[(0, 0, -1)] == 3
    assert reaches[(0.577, 0.577, 0.577)] == pytest.approx(6 / np.sqrt(3))


@pytest.mark.parametrize(
    "other",
    [
        placed(box_corners((0.1, 0.2, 0.3)), Pose.at(0.001, 0, 0)),
        placed(box_corners((0.1, 0.2, 0.3)), Pose.at(0, 0, 0, yaw=0.1)),
        box_corners((0.1, 0.2, 0.301)),
    ],
    ids=["moved", "turned", "longer"],
)
def test_another_box_reaches_elsewhere(other: np.ndarray) -> None:
    assert np.abs(reach(other) - reach(box_corners((0.1, 0.2, 0.3)))).max() > 4e-4


def test_the_order_of_shapes_does_not_matter() -> None:
    mirrored = [reach(placed(box_corners((1, 1, 1)), Pose.at(x, 0, 0))) for x in (-2.0, 2.0)]
    first, second = outlines("a", mirrored, []), outlines("a", mirrored[::-1], [])
    np.testing.assert_array_equal(first["a/boxes"], second["a/boxes"])
    assert first["a/meshes"].shape == (0, 26)


def stl_text() -> bytes:
    corners = "\n".join(f"vertex {x} {y} {z}" for x, y, z in TRIANGLE)
    return f"solid t\nfacet normal 0 0 1\nouter loop\n{corners}\nendloop\nendfacet\nend".encode()


def stl_binary() -> bytes:
    floats = np.zeros(12, "<f4")
    floats[3:] = TRIANGLE.ravel()
    return bytes(80) + (1).to_bytes(4, "little") + floats.tobytes() + bytes(2)


def obj_text() -> bytes:
    corners = "\n".join(f"v {x} {y} {z}" for x, y, z in TRIANGLE)
    return f"# t\n{corners}\nvn 0 0 1\nf 1 2 3\n".encode()


@pytest.mark.parametrize(
    ("name", "data"), [("a.stl", stl_text()), ("b.STL", stl_binary()), ("c.obj", obj_text())]
)
def test_meshes_are_read(tmp_path: Path, name: str, data: bytes) -> None:
    (tmp_path / name).write_bytes(data)
    points = mesh_points(str(tmp_path / name))
    np.testing.assert_array_equal(points, TRIANGLE[np.lexsort(TRIANGLE.T[::-1])])


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
