"""Planned motions: free of collisions, the same for the same seed, the study's throw; they keep the
limits, start and end at rest, and are as straight as they say."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_simbench.motion import planning
from pytest_simbench.motion.collision import PlanningScene
from pytest_simbench.motion.errors import PlanningError
from pytest_simbench.motion.kinematics import DECIMALS, inverse_kinematics, tool_over
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.panda import LIMITS, THROW_END, WIND_UP, panda
from pytest_simbench.motion.panda import READY as AT_READY
from pytest_simbench.motion.planning import MotionPlanner
from pytest_simbench.motion.timing import TICK, Timed, along_path, straight_move, synchronised_move
from pytest_simbench.scene import Box, FloatArray, Pose, Scene
from pytest_simbench.tasks import Jitter, Stacking

MODEL, READY = RobotModel(panda()), np.array(AT_READY)


@pytest.fixture
def scene() -> Scene:
    return Stacking().scene(0, Jitter(0.0, 0.0))


@pytest.fixture
def planner(scene: Scene) -> MotionPlanner:
    planning = PlanningScene(MODEL, scene)
    return MotionPlanner(MODEL, planning, np.random.default_rng(1), scene.gravity)


WALL = Box("wall", (0.1, 0.02, 0.5), Pose.at(0.5, 0.0, 0.55))


def around_the_wall(seed: int) -> tuple[FloatArray, bool]:
    """Planned positions from one side of a wall to the other, and whether they are free."""
    scene = Scene("wall", (Box("table", (0.9, 0.9, 0.3), Pose.at(0.6, 0, 0.15)), WALL), panda())
    planning = PlanningScene(MODEL, scene)
    planner = MotionPlanner(MODEL, planning, np.random.default_rng(seed), scene.gravity)
    start, goal = (
        inverse_kinematics(MODEL, tool_over(Pose.at(0.5, y, 0.45), 0.0), READY) for y in (-0.2, 0.2)
    )
    trajectory = planner.move_to(start, goal, 0.035)
    arm = trajectory.position[:, :7]
    assert np.allclose(arm[0], start)
    assert np.allclose(arm[-1], goal)
    return arm, planning.first_collision(arm, margin=False) is None


def test_a_wall_is_passed_without_touching() -> None:
    arm, free = around_the_wall(3)
    assert free
    straight = np.linspace(arm[0], arm[-1], len(arm))
    assert np.abs(arm - straight).max() > 0.1


def test_a_search_gives_up_after_so_many_checks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planning, "MAX_CHECKS", 5)
    with pytest.raises(PlanningError, match=r"^no path found in 6 checks$"):
        around_the_wall(3)


def test_same_seed_same_plan() -> None:
    first, _ = around_the_wall(3)
    other, _ = around_the_wall(4)
    again, _ = around_the_wall(3)
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_a_search_does_not_look_at_its_ends_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """OMPL waits for ever for a goal that it finds invalid, and a touch of nothing may waver."""
    looks: list[bytes] = []
    real = PlanningScene.collision

    def wavering(scene: PlanningScene, arm: FloatArray) -> tuple[str, str] | None:
        seen = arm.tobytes() in looks[:2]  # the start and the goal, which come first
        looks.append(arm.tobytes())
        return ("hand", "wall") if seen else real(scene, arm)

    monkeypatch.setattr(PlanningScene, "collision", wavering)
    assert around_the_wall(3)[1]
    assert len(looks) > 2


def test_fingers_open_at_the_release(planner: MotionPlanner) -> None:
    for feasible in (True, False):
        trajectory, throw = planner.throw(
            np.array(WIND_UP), np.array(THROW_END), 0.0, 0.035, 0.5, feasible=feasible
        )
        fingers = trajectory.position[:, 7:]
        assert (fingers[: throw.row] == 0.0).all()
        assert (fingers[throw.row :] == 0.035).all()
        half = 10.0 ** -DECIMALS[0] / 2  # of the last decimal
        told = trajectory.position, trajectory.velocity, trajectory.effort
        for rows, decimals in zip(told, DECIMALS, strict=True):
            assert np.array_equal(rows, rows.round(decimals))
            assert not np.signbit(rows[rows == 0.0]).any()
        assert np.allclose(trajectory.position[:, :7], throw.timed.position, 0.0, 1.01 * half)


def test_other_cubes_are_obstacles(scene: Scene, planner: MotionPlanner) -> None:
    cube = scene.body("cube_11").pose
    at = inverse_kinematics(MODEL, tool_over(cube, 0.0), READY)
    touching = planner.scene.collision(at)
    assert "cube_11" in touching
    assert planner.scene.collision(at, ignored=["cube_11"], margin=False) is None
    with pytest.raises(PlanningError, match="goal in collision: .*cube_11"):
        planner.move_to(READY, at, 0.035)


def test_what_cannot_be_planned_says_so(planner: MotionPlanner) -> None:
    with pytest.raises(PlanningError, match=r"^goal 0.002 rad or m beyond the limits of panda"):
        planner.move_to(READY, MODEL.upper + 0.002, 0.0)
    for speed in (0.0, 1.5):
        with pytest.raises(PlanningError, match="; give a share of the limits, above 0 to 1"):
            planner.move_to(READY, READY + 0.1, 0.0, speed=speed)
    for poses in ([MODEL.tool_pose(READY)], []):  # without a way the arm stays
        assert planner.move_along(READY, poses, 0.0, tool_speed=0.1).duration == 0.0


def test_a_held_cube_moves_with_the_hand(scene: Scene, planner: MotionPlanner) -> None:
    planning = planner.scene
    planning.opening = 0.025
    low = inverse_kinematics(MODEL, tool_over(Pose.at(0.6, 0.0, 0.385), 0.0), READY)
    assert planning.collision(low, margin=False) is None
    planning.update({"cube_01": Pose.at(0.6, 0.0, 0.325)})
    assert planning.collision(low, margin=False) is None
    planning.attach("cube_02", Pose.at(0.0, 0.0, 0.02))
    assert planning.collision(low, margin=False) == ("held cube_02", "cube_01")
    planning.held = None
    assert planning.collision(low, margin=False) is None


def test_both_positions_are_the_ends_of_what_is_checked_between_them(
    planner: MotionPlanner,
) -> None:
    rows = planner._segment(READY, READY + 0.1)
    assert len(rows) > 2
    assert rows[[0, -1]] == pytest.approx(np.array([READY, READY + 0.1]))
    assert np.diff(rows, axis=0) == pytest.approx(
        np.full((len(rows) - 1, 7), 0.1 / (len(rows) - 1))
    )


def test_checks_are_close_together(planner: MotionPlanner) -> None:
    goal = READY + np.array([1.0, -0.3, 0.2, 0.3, -0.5, 0.2, 1.0])
    rows = planner.move_to(READY, goal, 0.035).position[:, :7]
    tips = np.array([MODEL.tool_pose(q).position for q in planner._thinned(rows)])
    assert np.linalg.norm(np.diff(tips, axis=0), axis=1).max() < 0.035


def test_feed_forward_carries_the_arm(planner: MotionPlanner) -> None:
    still = planner.move_fingers(READY, 0.035, 0.0, 0.1)
    q = MODEL.full(READY)[None]
    zero = np.zeros_like(q)
    expected = MODEL.inverse_dynamics(planner.gravity, q, zero, zero)[0, :7]
    assert np.allclose(still.effort[:, :7], expected, atol=0.2)
    assert (still.effort[:, 7:] == 0).all()
    half = RobotModel(panda().with_joints(*panda().joint_names, gravity=0.5))  # its links' share
    assert np.allclose(half.inverse_dynamics(planner.gravity, q, zero, zero)[0, :7], expected / 2)


def test_a_path_at_a_speed_of_the_tool(planner: MotionPlanner) -> None:
    start = inverse_kinematics(MODEL, tool_over(Pose.at(0.4, 0.0, 0.5), 0.0), READY)
    poses = [tool_over(Pose.at(0.4, 0.01 * k, 0.5), 0.02 * k) for k in range(1, 21)]
    slow = planner.move_along(start, poses, 0.0, tool_speed=0.05)
    assert slow.duration == pytest.approx(0.2 / 0.05, rel=0.01)
    assert np.allclose(slow.position[-1, 7:], 0.0)
    fast = planner.move_along(start, poses, 0.0, tool_speed=50.0)  # beyond the joints' limits
    assert 0.2 < fast.duration < 2.0
    tips = np.array([MODEL.tool_pose(q).position for q in fast.position[:, :7]])
    assert np.allclose(tips[:, [0, 2]], [0.4, 0.5], atol=1e-3)


def test_a_path_touches_only_what_it_may() -> None:
    block = Box("block", (0.1, 0.1, 0.05), Pose.at(0.5, 0.0, 0.295), mass=0.1)
    scene = PlanningScene(MODEL, Scene("path", (block,), panda()))
    planner = MotionPlanner(MODEL, scene, np.random.default_rng(0), (0.0, 0.0, -9.81))
    start = inverse_kinematics(MODEL, tool_over(Pose.at(0.38, 0.0, 0.3), 0.0), READY)
    poses = [tool_over(Pose.at(0.38 + 0.01 * k, 0.0, 0.3), 0.0) for k in range(1, 13)]
    planner.move_along(start, poses, 0.0, tool_speed=0.1, ignored=("block",))
    with pytest.raises(PlanningError, match=r"^path blocked: panda_\w+ and block$"):
        planner.move_along(start, poses, 0.0, tool_speed=0.1)


def test_the_front_of_the_closed_hand() -> None:
    """Boxes of franka_description's fingers: 17.5 mm thick at the tips, each 15.2 mm wide; from
    24 mm above the tool centre point on they are 22 mm thick."""
    scene = PlanningScene(MODEL, Scene("front", (), panda()))
    assert scene.front(0.005) == pytest.approx((0.00875, 0.03036), abs=1e-5)
    depth, width = scene.front(0.02)
    assert depth == pytest.approx(0.00875, abs=1e-5)
    assert 0.0304 < width < 0.052
    assert scene.front(0.03) == pytest.approx((0.011, 0.052), abs=1e-5)


joints = st.lists(st.floats(-1.5, 1.5), min_size=7, max_size=7).map(np.array)


def check(timed: Timed) -> None:
    assert (np.abs(timed.velocity) <= LIMITS.column("velocity") * 1.001).all()
    assert (np.abs(timed.acceleration) <= LIMITS.column("acceleration") * 1.001).all()
    for row in (0, -1):
        assert np.abs(timed.velocity[row]).max() < 1e-6
    slope = np.diff(timed.position, axis=0)[:-1] / TICK
    middle = (timed.velocity[:-2] + timed.velocity[1:-1]) / 2
    assert np.allclose(slope, middle, atol=0.03)


@given(joints, joints, st.floats(0.2, 1.0))
@settings(max_examples=60, deadline=None)
def test_straight_move(start: np.ndarray, goal: np.ndarray, speed: float) -> None:
    timed = straight_move(start, goal, LIMITS, speed=speed)
    check(timed)
    assert np.allclose(timed.position[-1], goal, atol=1e-9)
    way = goal - start
    if np.linalg.norm(way) > 1e-3:
        share = (timed.position - start) @ way / (way @ way)
        assert np.abs(timed.position - start - share[:, None] * way).max() < 1e-9


@given(joints, joints)
@settings(max_examples=30, deadline=None)
def test_synchronised_move(start: np.ndarray, goal: np.ndarray) -> None:
    timed, duration = synchronised_move(start, goal, LIMITS)
    check(timed)
    assert np.allclose(timed.position[-1], goal, atol=1e-6)
    assert duration <= timed.duration < duration + TICK + 1e-9


def test_half_speed_takes_twice_as_long() -> None:
    start, goal = np.zeros(7), np.full(7, 1.0)
    full, half = (straight_move(start, goal, LIMITS, speed=speed).duration for speed in (1.0, 0.5))
    assert abs(half - 2 * full) <= 2 * TICK


def test_along_a_curved_path() -> None:
    s = np.linspace(0.0, 1.0, 20)[:, None]
    path = 0.5 * np.hstack([np.sin(s * k) for k in range(1, 8)])
    timed, slow, same = (
        along_path(rows, LIMITS, speed=speed)
        for rows, speed in ((path, 1.0), (path, 0.5), (np.repeat(path, 2, axis=0), 1.0))
    )
    check(timed)
    assert timed.duration == pytest.approx(3.272, abs=TICK)  # plans stay what they were
    assert slow.duration == pytest.approx(2 * timed.duration, abs=2 * TICK)
    assert np.array_equal(same.position, timed.position)  # a point twice changes nothing
    assert np.allclose(timed.position[[0, -1]], path[[0, -1]], atol=1e-6)
    away = np.linalg.norm(timed.position[:, None] - path, axis=2).min(axis=0)
    assert away.max() < 0.02  # it goes through all points
    assert [rows.tolist() for rows in along_path(path[[3, 3]], LIMITS)] == [
        [path[3].tolist()], [[0.0] * 7], [[0.0] * 7],
    ]  # fmt: skip
    rng = np.random.default_rng(271)  # uneven ways, between which the spline swings out
    uneven = np.cumsum(10 ** rng.uniform(-4, 0, (7, 1)) * rng.normal(size=(7, 7)), axis=0)
    check(timed := along_path(uneven, LIMITS))
    assert timed.duration == pytest.approx(4.392, abs=TICK)
