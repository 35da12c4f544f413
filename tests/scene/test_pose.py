"""Poses form a group."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.scene import Pose
from pytest_simbench.scene.pose import quaternion_of

numbers = st.floats(-10, 10, allow_nan=False)


@st.composite
def poses(draw: st.DrawFn) -> Pose:
    quaternion = np.array([draw(st.floats(-1, 1)) for _ in range(4)])
    if np.linalg.norm(quaternion) < 0.1:
        quaternion = np.array([1.0, 0.0, 0.0, 0.0])
    quaternion /= np.linalg.norm(quaternion)
    return Pose.from_array([draw(numbers), draw(numbers), draw(numbers), *quaternion])


@given(poses(), poses())
def test_composition_multiplies_matrices(a: Pose, b: Pose) -> None:
    assert np.allclose((a * b).matrix(), a.matrix() @ b.matrix(), atol=1e-9)


@given(poses())
def test_inverse_undoes(a: Pose) -> None:
    assert np.allclose((a * a.inverse()).matrix(), np.eye(4), atol=1e-9)


@given(poses())
def test_a_pose_travels_unchanged(a: Pose) -> None:
    assert Pose.from_wire(a.to_wire()) == a
    assert Pose.from_array(a.as_array()) == a


@given(st.floats(-math.pi + 1e-6, math.pi - 1e-6))
def test_yaw_is_read_back(yaw: float) -> None:
    assert Pose.at(0, 0, 0, yaw=yaw).yaw == pytest.approx(yaw, abs=1e-9)


@given(st.floats(0, math.radians(44)), st.integers(0, 3))
def test_tilt_is_the_angle_to_the_nearest_face(tilt: float, quarter: int) -> None:
    angle = tilt + quarter * math.pi / 2
    pose = Pose(quaternion=(math.cos(angle / 2), math.sin(angle / 2), 0.0, 0.0))
    assert pose.tilt() == pytest.approx(tilt, abs=1e-6)


@given(poses())
def test_the_quaternion_of_a_matrix_undoes_it(a: Pose) -> None:
    found = Pose(quaternion=tuple(quaternion_of(a.rotation())))
    assert np.allclose(found.rotation(), a.rotation(), atol=1e-9)
