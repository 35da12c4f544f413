"""Meshes become hulls with few corners, and lose little."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from pytest_simbench.robot.errors import RobotError
from pytest_simbench.robot.files import read_robot
from pytest_simbench.robot.hulls import extreme, stl
from pytest_simbench.robot.registry import find
from pytest_simbench.simulator.mesh_check import TRIANGLE
from pytest_simbench.simulator.robot_files import content_of
from tests.robot.small_arm import TOML, small_arm


@pytest.mark.parametrize("count", [50, 500])
def test_a_ball_stands_back_by_as_much_as_is_said(count: int) -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(20000, 3))
    points *= 0.05 / np.linalg.norm(points, axis=1)[:, None]
    few = points[extreme(points, count)]
    assert len(few) <= count
    hull = ConvexHull(few)
    back = 0.05 + hull.equations[:, 3]  # of each face
    assert 0.0 < back.max() < 4.5 * 0.05 / count


def test_a_box_keeps_its_corners_and_its_faces_look_outwards() -> None:
    corners = np.array(np.meshgrid([0, 0.3], [0, 0.1], [0, 0.02])).reshape(3, -1).T
    inside = np.random.default_rng(0).uniform(size=(500, 3)) * [0.3, 0.1, 0.02]
    points = np.vstack([corners, inside])
    kept = points[extreme(points, 500)]
    assert {tuple(point) for point in kept} == {tuple(point) for point in corners}
    data = stl(kept)
    triangles = np.frombuffer(data, TRIANGLE, offset=84)
    assert int.from_bytes(data[80:84], "little") == len(triangles) == 12
    a, b, c = triangles["corners"].astype(float).transpose(1, 0, 2)
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6  # positive: all outwards
    assert volume == pytest.approx(0.3 * 0.1 * 0.02, rel=1e-5)


def test_a_robot_file_asks_for_them(tmp_path: Path) -> None:
    meshes = content_of(find("so101"))["meshes"].values()
    assert len(meshes) == 13
    assert all(len(data) <= 84 + 50 * 2 * 500 for data in meshes)  # Euler: 2 n - 4 triangles
    with pytest.raises(RobotError, match="hull_corners: give a whole number of at least 50"):
        read_robot(small_arm(tmp_path, "hull_corners = 12\n" + TOML))
