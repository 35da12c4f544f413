"""Scenes, poses and trajectories: what they hold, and how they cross."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.motion.panda import panda
from pytest_simbench.scene import Box, Pose, Scene, SceneError, Sphere, Start, Trajectory, Vector3
from pytest_simbench.scene.plausibility import implausible
from pytest_simbench.scene.pose import principal_axes, quaternion_of, turn_of_z


def box(name: str, x: float, **more: float) -> Box:
    return Box(name, (0.05, 0.05, 0.05), Pose.at(x, 0.0, 0.025), mass=0.1, **more)


def test_two_bodies_of_one_name_are_an_error() -> None:
    with pytest.raises(SceneError, match="2 bodies are named 'a'"):
        Scene("s", (box("a", 0.0), box("a", 1.0)))


def test_overlapping_bodies_are_an_error_that_names_both() -> None:
    with pytest.raises(SceneError, match="'a' and 'b' overlap by 10.0 mm"):
        Scene("s", (box("a", 0.0), box("b", 0.04)))
    Scene("s", (box("a", 0.0), box("b", 0.05)))  # they touch
    large = [Box(name, (2.0, 2.0, 2.0), Pose.at(x, 0, 1), 1.0) for name, x in (("a", 0), ("b", 2))]
    with pytest.raises(SceneError, match="'a' and 'b' overlap by 1900.0 mm"):
        Scene("s", (large[0], large[1].moved_to(Pose.at(0.1, 0, 1))))
    rows = np.array([[x, 0.0, 1.0, 1.0, *[0.0] * 9] for x in (0.0, 0.1)])
    assert implausible(Scene("s", tuple(large)), rows) == "'a' and 'b' overlap by 1900 mm"


def test_a_scene_travels_unchanged() -> None:
    scene = Scene("s", (box("a", 0.0), Box("t", (1, 1, 0.1), Pose.at(0, 0, -0.05))), panda())
    assert Scene.from_wire(json.loads(json.dumps(scene.to_wire()))) == scene


def test_an_unknown_body_lists_the_known_ones() -> None:
    with pytest.raises(KeyError, match=r"it has \['a'\]"):
        Scene("s", (box("a", 0.0),)).body("b")


def test_pairs_kept_apart_may_be_inside_each_other() -> None:
    bodies = (box("a", 0.0), box("b", 0.01))
    apart = (("body/b", "body/a"), ("ground", "body/a"))
    scene = Scene("s", bodies, apart=apart)
    assert scene.kept_apart("body/a", "body/b")
    assert not scene.kept_apart("body/b", "ground")
    assert Scene.from_wire(json.loads(json.dumps(scene.to_wire()))) == scene
    rows = np.array([[*body.pose.as_array(), *[0.0] * 6] for body in bodies])
    sunk = rows - [0, 0, 2.0, *[0.0] * 10]
    assert implausible(scene, rows) is None
    assert implausible(scene, np.array([sunk[0], rows[1]])) is None
    assert "'b' is 2000 mm deep in the ground" in str(implausible(scene, sunk))


@pytest.mark.parametrize("name", ["body/c", "box", "link/hand"])
def test_a_pair_of_what_is_not_there_is_an_error(name: str) -> None:
    with pytest.raises(SceneError, match=f"'{name}' is kept apart and not there"):
        Scene("s", (box("a", 0.0),), apart=(("ground", name),))


def test_a_start_moves_bodies_and_joints() -> None:
    robot = panda()
    scene = Scene("s", (box("a", 0.0), box("b", 1.0)), robot)
    positions = tuple(0.1 * k for k in range(len(robot.joints)))
    started = scene.at_start(Start(("b",), (Pose.at(2.0, 0.0, 0.3),), positions))
    assert started.body("b").pose.position == (2.0, 0.0, 0.3)
    assert started.body("a") == scene.body("a")
    assert [joint.initial_position for joint in started.robot.joints] == list(positions)
    assert scene.at_start(Start((), ())) == scene
    for wrong in (Start(("a", "b"), (Pose(),)), Start((), (), positions[1:])):
        with pytest.raises(ValueError, match=r"zip\(\) argument 2 is shorter than argument 1"):
            scene.at_start(wrong)


def test_a_ground_that_bounces_crosses_and_another_is_not_named() -> None:
    bouncing = Scene("s", ground_restitution=0.5)
    assert Scene.from_wire(bouncing.to_wire()) == bouncing
    assert "ground_restitution" not in Scene("s").to_wire()
    with pytest.raises(SceneError, match="the ground's restitution in scene 's' is 2"):
        Scene("s", ground_restitution=2.0)


def test_a_scene_bounces_by_its_ground_or_by_one_body() -> None:
    ball = Sphere("ball", 0.1, Pose.at(0, 0, 1), 1.0, restitution=0.5)
    assert "restitution" in Scene("s", ground_restitution=0.5).words
    assert "restitution" in Scene("s", (ball,)).words
    assert "restitution" not in Scene("s", (box("a", 1.0),)).words


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
    assert Pose.from_array(a.as_array()) == a


@pytest.mark.parametrize("way", [(0, 0, 1), (0.48, -0.6, 0.64), (0, 1, 0), (0.6, 0, -0.8)])
def test_a_turn_of_z_is_the_shortest_to_a_direction(way: Vector3) -> None:
    w, x, y, z = turn_of_z(np.array(way))
    assert (w, z) == (pytest.approx(math.cos(math.acos(way[2]) / 2)), 0.0)
    assert Pose(quaternion=(w, x, y, z)).rotation()[:, 2] == pytest.approx(way)
    assert turn_of_z(np.array([0.0, 0.0, -1.0])) == (0.0, 1.0, 0.0, 0.0)


@pytest.mark.parametrize(("turn", "tilt"), [(0, 0), (30, 30), (80, 10), (90, 0), (130, 40)])
def test_a_tilt_is_to_the_nearest_face(turn: float, tilt: float) -> None:
    half = math.radians(turn) / 2
    for axis in np.eye(3)[:2]:
        leaning = Pose.from_array([0, 0, 0, math.cos(half), *math.sin(half) * axis])
        tilted = (Pose.at(1, 2, 3, yaw=0.7) * leaning).tilt()
        assert math.degrees(tilted) == pytest.approx(tilt, abs=1e-5)
    assert Pose.at(1, 2, 3, yaw=0.5).translated(0.1, 0.2, 0.4) == Pose.at(1.1, 2.2, 3.4, yaw=0.5)


def test_set_points_between_the_rows_by_hand() -> None:
    """Rows at 0, 0.1 and 0.2 s; the last is held to the end of a step that ends later."""
    rows = np.array([[0.0, 0.0], [1.0, 2.0], [2.0, 0.0]])
    found = Trajectory(0.1, rows, 2 * rows, -rows).resampled(0.04)
    right = np.array([[0.4, 0.8], [0.8, 1.6], [1.2, 1.6], [1.6, 0.8], [2.0, 0.0]])
    rows_of = np.array([found.position, found.velocity / 2, -found.effort])
    assert (found.tick, rows_of) == (0.04, pytest.approx(np.array([right] * 3)))
    once = Trajectory(0.1, rows, rows, rows)
    assert once.resampled(0.15).position == pytest.approx(np.array([[1.5, 1.0]]))
    assert once.resampled(0.5).position == pytest.approx(np.array([[2.0, 0.0]]))
    assert once.duration == pytest.approx(0.2)
    held = Trajectory.holding(0.1, rows[1], rows[2])
    right = np.array([[[1, 2]] * 2, [[0, 0]] * 2, [[2, 0]] * 2])
    assert np.array_equal([held.position, held.velocity, held.effort], right)
    assert not Trajectory.holding(0.1, rows[1]).effort.any()


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
    assert begins_positive(found.quaternion)


@given(poses())
def test_principal_axes_have_one_sign(a: Pose) -> None:
    """Scenes are told apart by a digest: no two machines may write them in two ways."""
    turn, moments = a.rotation(), np.diag([1.0, 2.0, 4.0])
    found, axes = principal_axes(turn @ moments @ turn.T)
    assert np.allclose(found, [1.0, 2.0, 4.0])
    assert np.allclose(axes * found @ axes.T, turn @ moments @ turn.T)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert begins_positive(axes[:, 1])
    assert begins_positive(axes[:, 2])


def begins_positive(numbers: Any) -> bool:
    return next(x for x in numbers if abs(x) > 1e-6) > 0


TIMESTEPS = st.sampled_from([0.0005, 0.001, 0.002, 1 / 240, 0.004, 0.01])


@given(st.integers(2, 50), TIMESTEPS)
def test_a_linear_motion_stays_linear_and_each_array_itself(rows: int, timestep: float) -> None:
    ramp = np.linspace(0.0, 1.0, rows)[:, None] * np.ones(3)
    trajectory = Trajectory(0.004, ramp, 2 * ramp, -3 * ramp)
    resampled = trajectory.resampled(timestep)
    steps = len(resampled.position)
    share = np.minimum(np.arange(1, steps + 1) * timestep / trajectory.duration, 1.0)[:, None]
    assert np.allclose(resampled.position, share, atol=1e-9)
    assert np.allclose(resampled.velocity, 2 * share, atol=1e-9)
    assert np.allclose(resampled.effort, -3 * share, atol=1e-9)
    assert resampled.tick == timestep


def test_one_set_point_is_held_at_rest() -> None:
    goal, effort = np.array([0.1, -0.2]), np.array([3.0, 4.0])
    held = Trajectory.holding(0.004, goal, effort)
    assert (held.tick, held.duration) == (0.004, 0.004)
    assert held.position.tolist() == [goal.tolist()] * 2
    assert held.velocity.tolist() == [[0.0, 0.0]] * 2
    assert held.effort.tolist() == [effort.tolist()] * 2
    assert Trajectory.holding(0.004, goal).effort.tolist() == [[0.0, 0.0]] * 2


def test_whole_numbers_are_numbers() -> None:
    held = Trajectory(0.1, [[1], [2]], [[0], [0]], [[3], [4]])
    column = panda().with_joints(*panda().joint_names, armature=1).column("armature")
    for rows in (held.position, held.velocity, held.effort, column):
        assert rows.dtype == float


def test_a_hand_squeezes_with_the_limit_of_its_drives() -> None:
    robot = panda().squeezing(3.0)
    assert robot.gripper.squeeze == 3.0
    assert robot.column("effort_limit")[robot.finger_indices].tolist() == [3.0, 3.0]


@given(st.integers(2, 50), TIMESTEPS)
def test_it_ends_within_half_a_step_of_its_end(rows: int, timestep: float) -> None:
    """No step is left out or added, but that there is always one."""
    flat = np.zeros((rows, 1))
    trajectory = Trajectory(0.004, flat, flat, flat)
    late = len(trajectory.resampled(timestep).position) * timestep - trajectory.duration
    assert late <= timestep / 2 + 1e-12 or trajectory.duration < timestep / 2
    assert late >= -timestep / 2 - 1e-12


@pytest.mark.parametrize(
    ("timestep", "expected"),
    [
        (0.004, [1.0, 4.0, 9.0]),  # at the rows: row 0, the start, is not commanded again
        (0.002, [0.5, 1.0, 2.5, 4.0, 6.5, 9.0]),  # between them, straight
        (0.008, [4.0, 9.0]),  # beyond the end, the end
        (0.1, [9.0]),
    ],
)
def test_a_bent_motion_is_sampled_straight_between_its_rows(
    timestep: float, expected: list[float]
) -> None:
    rows = [[0.0], [1.0], [4.0], [9.0]]
    found = Trajectory(0.004, rows, rows, rows).resampled(timestep)
    assert found.position.ravel().tolist() == pytest.approx(expected)


@pytest.mark.parametrize(
    ("tick", "shape", "value", "said"),
    [
        (0.0, (3, 2), 0.0, "the tick .* is 0.0"),
        (math.nan, (3, 2), 0.0, "the tick .* is nan"),
        (0.1, (3,), 0.0, r"a trajectory of the shapes \(3,\), \(3, 2\), \(3, 2\)"),
        (0.1, (2, 2), 0.0, "a trajectory of the shapes"),
        (0.1, (0, 2), 0.0, "a trajectory of the shapes"),
        (0.1, (3, 2), math.nan, "a trajectory holds a number that is not finite"),
        (0.1, (3, 2), math.inf, "a trajectory holds a number that is not finite"),
    ],
)
def test_a_motion_that_is_none(
    tick: float, shape: tuple[int, ...], value: float, said: str
) -> None:
    rows = np.zeros((3, 2))
    with pytest.raises(SceneError, match=said):
        Trajectory(tick, np.full(shape, value), rows, rows)
