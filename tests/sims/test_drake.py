"""What only Drake's adapter has to show: corner spheres, which stay within their box and reach its
faces, the brakes of joints with friction, and its window in a browser."""

from __future__ import annotations

import urllib.request
from urllib.error import URLError

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pytest_simbench.sims.drake.adapter import Drake
from pytest_simbench.sims.drake.world import corner_centres, fitting_radius, pad_centres

from pytest_simbench.laws.mechanisms import mechanism
from pytest_simbench.motion.panda import panda
from pytest_simbench.scene import STANDARD_GRAVITY, Box, Pose, Scene
from pytest_simbench.simulator import PreparedRobot
from pytest_simbench.tasks import Jitter, Stacking
from pytest_simbench.testing import joints

from .worlds import loaded, stepped

SCENE = Stacking().scene(1, Jitter())


@pytest.mark.parametrize(("profile", "spheres"), [("default", 0), ("tuned", 8)])
def test_only_tuned_adds_spheres(profile: str, spheres: int) -> None:
    simulator = loaded(Drake, SCENE, profile)
    assert len(simulator.world.shapes["cube_05"]) == 1 + spheres
    assert len(simulator.world.shapes["table"]) == 1
    simulator.close()


def test_tuned_cube_rests_on_its_four_lower_corners() -> None:
    cube = Box("cube", (0.05, 0.05, 0.05), Pose.at(0.4, 0.0, 0.025), 0.1)
    simulator = stepped(loaded(Drake, Scene("one", (cube,))), 0.3)
    results = simulator.plant.get_contact_results_output_port().Eval(simulator.context)
    infos = [results.point_pair_contact_info(k) for k in range(simulator.contact_count())]
    places = np.array([info.contact_point() for info in infos])
    simulator.close()
    corners = [0.4, 0.0] + 0.021 * np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)])
    near = np.linalg.norm(places[:, None, :2] - corners[None], axis=2).argmin(axis=1)
    assert sorted(near) == [0, 1, 2, 3]
    weight = sum(abs(info.contact_force()[2]) for info in infos)
    assert weight == pytest.approx(0.1 * 9.80665, rel=1e-3)


def test_a_joint_with_friction_keeps_its_rotor_inertia() -> None:
    """Its brake is an actuator too, and of several Drake takes the rotor inertia of the last."""
    robot = mechanism("braked", joints.slider("braked", friction=4.0))
    scene = Scene("braked", robot=robot.with_joints("braked", armature=1.0))
    simulator = stepped(loaded(Drake, scene), 0.2)
    falls = simulator.joint_state()[1, 0] / simulator.time
    simulator.close()
    expected = (joints.MASS * STANDARD_GRAVITY[2] + 4.0) / (joints.MASS + 1.0)
    assert falls == pytest.approx(expected, rel=1e-3)


def test_window_is_a_page_that_goes_with_its_world() -> None:
    simulator = Drake(Drake.profiles["tuned"], gui=True)
    simulator.load(SCENE)
    simulator.refresh_window()
    url = simulator._meshcat.web_url()
    with urllib.request.urlopen(url, timeout=10) as answer:
        assert b"meshcat" in answer.read().lower()
    for name in ("cube_05", "panda/panda_link4"):
        assert simulator._meshcat.HasPath(f"/drake/visualizer/{name}")
    simulator.close()
    with pytest.raises(URLError):
        urllib.request.urlopen(url, timeout=10)


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
