"""Where the nearest joint positions touch something, an arm takes others."""

from __future__ import annotations

import numpy as np
import pytest

from pytest_simbench.robot import grasping
from pytest_simbench.robot.collision import PlanningScene
from pytest_simbench.robot.errors import PlanningError
from pytest_simbench.robot.grasping import choose
from pytest_simbench.robot.kinematics import tool_over, top_down_grasps
from pytest_simbench.robot.model import RobotModel
from pytest_simbench.robot.registry import find
from pytest_simbench.scene import Pose
from pytest_simbench.tasks import Stacking
from pytest_simbench.tasks.base import Jitter


def choices(name: str) -> list[str]:
    """What is wrong with the cubes of stacking that cannot be taken."""
    robot = find(name)
    scene = Stacking(robot=robot).scene(2022, Jitter())
    model = RobotModel(robot)
    planning = PlanningScene(model, scene)
    home = robot.column("initial_position")[: model.arm]
    rng, problems = np.random.default_rng(0), []
    for cube in scene.free_bodies:
        tools = top_down_grasps(cube.pose)
        try:
            found = choose(planning, tools, 0.1, home, home, rng, (cube.name,))
        except PlanningError as error:
            problems.append(str(error))
            continue
        assert found.tool in tools
        over = model.tool_pose(found.above)
        assert over.position == pytest.approx(found.tool.translated(z=0.1).position, abs=1e-5)
        assert planning.collision(found.above, ignored=(cube.name,)) is None
    return problems


@pytest.mark.parametrize("name", ["panda", "ur5", "xarm7"])
def test_every_cube_can_be_taken(name: str) -> None:
    assert choices(name) == []


def test_the_nearest_positions_alone_leave_cubes_of_the_ur5(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(grasping, "FURTHER_RESTARTS", 0)
    problems = choices("ur5")
    assert any(problem.startswith("in collision: upper_arm") for problem in problems)


def test_what_cannot_be_reached_is_told() -> None:
    robot = find("panda")
    model = RobotModel(robot)
    planning = PlanningScene(model, Stacking().scene(2022, Jitter()))
    home = robot.column("initial_position")[: model.arm]
    tools = [tool_over(Pose.at(2.0, 0.0, 0.5), 0.0)]
    with pytest.raises(PlanningError, match="unreachable"):
        choose(planning, tools, 0.1, home, home, np.random.default_rng(0))
