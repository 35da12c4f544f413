"""Corner spheres stay within their box and reach its faces."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from pytest_simbench.sims.drake.world import corner_centres, fitting_radius, pad_centres

from pytest_simbench.motion.panda import panda
from pytest_simbench.simulator import PreparedRobot

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
