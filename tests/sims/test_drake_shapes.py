"""Corner spheres stay within their box and reach its faces; STL files are read or refused."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from pytest_simbench.sims.drake_shapes import (
    corner_centres,
    fitting_radius,
    pad_centres,
    stl_points,
)

from pytest_simbench.robot.panda import panda
from pytest_simbench.simulator import DescriptionError, PreparedRobot

edges = st.tuples(*[st.floats(0.004, 1.0)] * 3)
radii = st.floats(1e-4, 0.02)


@given(edges, radii)
def test_spheres_touch_every_face_from_within(size: tuple[float, ...], wanted: float) -> None:
    radius = fitting_radius(size, wanted)
    assert 0 < radius <= wanted
    centres = corner_centres(size, radius)
    assert len(np.unique(centres, axis=0)) == 8
    np.testing.assert_allclose((centres + radius).max(axis=0), np.asarray(size) / 2)
    np.testing.assert_allclose((centres - radius).min(axis=0), -np.asarray(size) / 2)


@given(edges, radii)
def test_spheres_of_a_box_never_overlap(size: tuple[float, ...], wanted: float) -> None:
    radius = fitting_radius(size, wanted)
    centres = corner_centres(size, radius)
    gaps = np.linalg.norm(centres[:, None] - centres[None], axis=2)
    assert gaps[~np.eye(8, dtype=bool)].min() >= 2 * radius * (1 - 1e-9)


def test_pads_lie_on_the_gripping_faces_of_both_fingers() -> None:
    """Four spheres each; touching the plane in which the closed fingers meet; and mirrored."""
    prepared, radius = PreparedRobot(panda()), 0.003
    left, right = (
        pad_centres(prepared, joint, radius)
        for joint in prepared.joints
        if joint.name in prepared.robot.gripper.joints
    )
    assert len(left) == len(right) == 4
    np.testing.assert_allclose(left[:, 1], radius, atol=1e-4)
    mirrored = right * [1, -1, 1]
    np.testing.assert_allclose(np.sort(left, axis=0), np.sort(mirrored, axis=0), atol=1e-9)
    assert np.ptp(left[:, 0]) > 0.01
    assert np.ptp(left[:, 2]) > 0.01


triangles = arrays(
    np.float32, st.tuples(st.integers(1, 20), st.just(9)), elements=st.floats(-10, 10, width=32)
)


def written(path: Path, corners: NDArray[np.float32]) -> bytes:
    records = [struct.pack("<12fH", 0, 0, 1, *values, 0) for values in corners]
    data = bytes(80) + struct.pack("<I", len(corners)) + b"".join(records)
    path.write_bytes(data)
    return data


@given(triangles)
def test_stl_gives_the_corners_that_were_written(
    tmp_path_factory: pytest.TempPathFactory, corners: NDArray[np.float32]
) -> None:
    path = tmp_path_factory.mktemp("stl") / "part.stl"
    written(path, corners)
    expected = np.unique(corners.reshape(-1, 3).astype(float), axis=0)
    np.testing.assert_array_equal(stl_points(str(path)), expected)


@pytest.mark.parametrize("damage", ["cut", "longer", "text", "empty"])
def test_damaged_stl_is_refused_by_name(tmp_path: Path, damage: str) -> None:
    path = tmp_path / "part.stl"
    data = written(path, np.arange(9, dtype=np.float32)[None])
    damaged = {
        "cut": data[:-1],
        "longer": data + b"x",
        "text": b"solid part\n facet normal 0 0 1\n" * 5,
        "empty": b"",
    }
    path.write_bytes(damaged[damage])
    with pytest.raises(DescriptionError, match=r"part\.stl is no binary STL file"):
        stl_points(str(path))
