"""Planned motions: free of collisions, the same for the same seed, the study's throw."""

from __future__ import annotations

import numpy as np
import pytest

from pytest_simbench.robot.collision import PlanningScene
from pytest_simbench.robot.errors import InCollision
from pytest_simbench.robot.kinematics import inverse_kinematics, tool_over
from pytest_simbench.robot.model import RobotModel
from pytest_simbench.robot.panda import THROW_END, WIND_UP, panda
from pytest_simbench.robot.planning import MotionPlanner
from pytest_simbench.scene import Box, FloatArray, Pose, Scene

WALL = Box("wall", (0.1, 0.02, 0.5), Pose.at(0.5, 0.0, 0.55))


def around_the_wall(model: RobotModel, ready: FloatArray, seed: int) -> tuple[FloatArray, bool]:
    """Planned positions from one side of a wall to the other, and whether they are free."""
    scene = Scene("wall", (Box("table", (0.9, 0.9, 0.3), Pose.at(0.6, 0, 0.15)), WALL), panda())
    planning = PlanningScene(model, scene)
    planner = MotionPlanner(model, planning, np.random.default_rng(seed), scene.gravity)
    start, goal = (
        inverse_kinematics(model, tool_over(Pose.at(0.5, y, 0.45), 0.0), ready) for y in (-0.2, 0.2)
    )
    trajectory = planner.move_to(start, goal, 0.035)
    arm = trajectory.position[:, :7]
    assert np.allclose(arm[0], start)
    assert np.allclose(arm[-1], goal)
    return arm, planning.first_collision(arm, margin=False) is None


def test_a_wall_is_passed_without_touching(model: RobotModel, ready: FloatArray) -> None:
    arm, free = around_the_wall(model, ready, 3)
    assert free
    straight = np.linspace(arm[0], arm[-1], len(arm))
    assert np.abs(arm - straight).max() > 0.1


def test_same_seed_same_plan(model: RobotModel, ready: FloatArray) -> None:
    first, _ = around_the_wall(model, ready, 3)
    other, _ = around_the_wall(model, ready, 4)
    again, _ = around_the_wall(model, ready, 3)
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_fingers_open_at_the_release(planner: MotionPlanner) -> None:
    for feasible in (True, False):
        trajectory, throw = planner.throw(
            np.array(WIND_UP), np.array(THROW_END), 0.0, 0.035, 0.5, feasible=feasible
        )
        fingers = trajectory.position[:, 7:]
        assert (fingers[: throw.row] == 0.0).all()
        assert (fingers[throw.row :] == 0.035).all()
        assert np.array_equal(trajectory.position[:, :7], throw.timed.position)


def test_other_cubes_are_obstacles(
    model: RobotModel, scene: Scene, planner: MotionPlanner, ready: FloatArray
) -> None:
    cube = scene.body("cube_11").pose
    at = inverse_kinematics(model, tool_over(cube, 0.0), ready)
    touching = planner.scene.collision(at)
    assert touching is not None
    assert "cube_11" in touching
    assert planner.scene.collision(at, ignored=["cube_11"], margin=False) is None
    with pytest.raises(InCollision, match="goal in collision: .*cube_11"):
        planner.move_to(ready, at, 0.035)


def test_a_held_cube_moves_with_the_hand(
    model: RobotModel, scene: Scene, planner: MotionPlanner, ready: FloatArray
) -> None:
    planning = planner.scene
    planning.opening = 0.025
    low = inverse_kinematics(model, tool_over(Pose.at(0.6, 0.0, 0.385), 0.0), ready)
    assert planning.collision(low, margin=False) is None
    planning.update({"cube_01": Pose.at(0.6, 0.0, 0.325)})
    assert planning.collision(low, margin=False) is None
    planning.attach("cube_02", Pose.at(0.0, 0.0, 0.02))
    assert planning.collision(low, margin=False) == ("held cube_02", "cube_01")
    planning.detach()
    assert planning.collision(low, margin=False) is None


def test_checks_are_close_together(planner: MotionPlanner, ready: FloatArray) -> None:
    goal = ready + np.array([1.0, -0.3, 0.2, 0.3, -0.5, 0.2, 1.0])
    rows = planner.move_to(ready, goal, 0.035).position[:, :7]
    model = planner.model
    tips = np.array([model.tool_pose(q).position for q in planner._thinned(rows)])
    assert np.linalg.norm(np.diff(tips, axis=0), axis=1).max() < 0.035


def test_feed_forward_carries_the_arm(planner: MotionPlanner, ready: FloatArray) -> None:
    still = planner.move_fingers(ready, 0.035, 0.0, 0.1)
    model = planner.model
    q = model.full(ready)[None]
    zero = np.zeros_like(q)
    expected = model.inverse_dynamics(planner.gravity, q, zero, zero)[0, :7]
    assert np.allclose(still.effort[:, :7], expected, atol=0.2)
    assert (still.effort[:, 7:] == 0).all()
