"""Meshes become hulls with few corners, and lose little."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from pytest_simbench.description.mesh_check import read_stl, written_stl
from pytest_simbench.description.robot_files import content_of
from pytest_simbench.motion.hulls import Cuts, extreme, stl, with_hulls
from pytest_simbench.motion.registry import find


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
    triangles = read_stl(stl(kept))
    assert len(triangles) == 12
    a, b, c = triangles.transpose(1, 0, 2)
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6  # positive: all outwards
    assert volume == pytest.approx(0.3 * 0.1 * 0.02, rel=1e-5)


def test_slices_fill_the_part_and_keep_to_their_planes() -> None:
    """An L, cut where its arms meet, is two boxes; one hull of it would fill the corner."""
    lying = [[x, y, z] for x in (0.0, 0.1) for y in (0.0, 0.02) for z in (0.0, 0.03)]
    standing = [[x, y, z] for x in (0.0, 0.02) for y in (0.02, 0.1) for z in (0.0, 0.03)]
    halves = [read_stl(stl(np.array(part))) for part in (lying, standing)]
    data = written_stl(np.concatenate(halves))
    urdf = """<robot name="r"><link name="l"><collision><origin xyz="0 0.3 0" rpy="0 0 0"/>
        <geometry><mesh filename="l.stl"/></geometry></collision></link></robot>"""
    cut = {"l": Cuts("y", (0.32,))}
    kept = with_hulls({"urdf": urdf, "meshes": {"l.stl": data}}, 500, cut)
    parts = map(read_stl, kept["meshes"].values())
    volumes = [ConvexHull(part.reshape(-1, 3)).volume for part in parts]
    assert sorted(volumes) == pytest.approx([0.08 * 0.02 * 0.03, 0.1 * 0.02 * 0.03], rel=1e-5)
    assert kept["urdf"].count("<collision>") == 2
    whole = with_hulls({"urdf": urdf, "meshes": {"l.stl": data}}, 500)
    (hull,) = map(read_stl, whole["meshes"].values())
    assert ConvexHull(hull.reshape(-1, 3)).volume > 1.5 * sum(volumes)


def test_a_robot_file_asks_for_them() -> None:
    meshes = content_of(find("so101"))["meshes"].values()
    assert len(meshes) == 21  # 13 parts, two of them cut into 6 and 4 slices
    assert all(len(data) <= 84 + 50 * 2 * 126 for data in meshes)  # Euler: 2 n - 4 triangles
