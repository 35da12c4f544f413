"""The arm as the tasks use it: what is planned how fast, held or lost, and put back."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pytest_simbench.motion.errors import PlanningError
from pytest_simbench.motion.kinematics import tool_over
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.panda import READY
from pytest_simbench.motion.planning import MotionPlanner
from pytest_simbench.scene import Box, Pose, Scene, Trajectory
from pytest_simbench.tasks import Jitter, Stacking
from pytest_simbench.tasks.arm import FULL_SPEED, LostBody, Speeds
from pytest_simbench.tasks.base import Randomness
from pytest_simbench.tasks.manipulator import Manipulator
from tests.tasks.scripted import Mishap, ScriptedProcess, ScriptedWorld, drop, move, slip

CUBE = "cube_11"
"""In the middle of the grid, straight before the arm."""

PLACE = Pose.at(0.5, 0.0, 0.33)


class Arm:
    """A manipulator in a world of the script."""

    def __init__(self, *script: Mishap, speeds: Speeds | None = None, seed: int = 1) -> None:
        self.process = ScriptedProcess(script)
        self.process.where.phase = "it"
        scene = Stacking().scene(seed, Jitter(0.0, 0.0))
        self.world = ScriptedWorld(self.process, scene)
        self.process.where.phase = "it"
        self.manipulator = Manipulator(self.world, Randomness.of(seed).planner, speeds)

    def put(self, name: str, pose: Pose) -> None:
        """A cube is elsewhere, and the world has been looked at since."""
        self.process.poses[name] = pose
        self.world.wait(0.1)

    @property
    def tools(self) -> list[Pose]:
        """Where the tool was commanded to at the end of each motion."""
        scene = self.world.scene
        model = RobotModel(scene.robot)
        return [model.tool_pose(end[:7]) for end in self.ends]

    @property
    def ends(self) -> list[np.ndarray]:
        """All joints as commanded at the end of each motion."""
        return [a.arguments["position"][-1] for a in self.process.asked if a.kind == "follow"]

    @property
    def fingers(self) -> list[float]:
        return [float(end[-1]) for end in self.ends]


@pytest.fixture
def arm() -> Arm:
    return Arm()


@pytest.fixture
def holding(arm: Arm) -> Arm:
    """With the cube in its hand."""
    arm.manipulator.pick(CUBE)
    return arm


def positions(tools: list[Pose]) -> np.ndarray:
    return np.array([tool.position for tool in tools])


def test_picking_approaches_from_above_grasps_and_lifts(holding: Arm) -> None:
    x, y, z = holding.process.scene.body(CUBE).pose.position
    assert positions(holding.tools) == pytest.approx(
        np.array([[x, y, z + 0.10], [x, y, z], [x, y, z], [x, y, z + 0.10]]), abs=1e-4
    )
    assert holding.fingers == [0.035, 0.035, 0.0, 0.0]
    assert [round(asked.duration, 3) for asked in holding.process.asked][2] == 0.476
    assert holding.manipulator.held == CUBE
    assert holding.process.poses[CUBE].position == pytest.approx([x, y, z + 0.10], abs=1e-4)
    down = [tool.rotation()[:, 2] for tool in holding.tools]
    assert np.array(down) == pytest.approx(np.array([[0, 0, -1.0]] * 4), abs=1e-4)


def test_placing_carries_lowers_and_opens(holding: Arm) -> None:
    before = len(holding.process.asked)
    holding.manipulator.place(PLACE)
    assert positions(holding.tools[before:]) == pytest.approx(
        np.array([[0.5, 0, 0.43], [0.5, 0, 0.33], [0.5, 0, 0.33]]), abs=1e-4
    )
    assert holding.fingers[before:] == [0.0, 0.0, 0.035]
    assert round(holding.process.asked[-1].duration, 3) == 0.376  # 0.176 to open, 0.2 more
    assert holding.manipulator.held is None
    (name, pose), opened = holding.process.released[0], holding.process.asked[-1].began
    assert (name, pose.position) == (CUBE, pytest.approx([0.5, 0.0, 0.33], abs=1e-5))
    assert holding.manipulator.time_since_release() == pytest.approx(holding.world.time - opened)
    assert holding.manipulator.try_retreat() is None
    assert holding.tools[-1].position == pytest.approx([0.5, 0.0, 0.43], abs=1e-4)
    assert holding.manipulator.try_go_home() is None
    assert holding.process.asked[-1].arguments["position"][-1, :7] == pytest.approx(READY)


def test_the_place_may_turn_by_quarters_only() -> None:
    """The cube's own yaw to the place's, whichever side was grasped."""
    for yaw in (0.0, 0.3, -0.7):
        arm = Arm()
        arm.put(CUBE, Pose.at(0.3, 0.0, 0.325, yaw=yaw))
        arm.manipulator.pick(CUBE)
        arm.manipulator.place(PLACE)
        turn = arm.process.poses[CUBE].yaw / (np.pi / 2)
        assert turn - round(turn) == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize("speeds", [Speeds(0.9, 0.7, 0.5), None, FULL_SPEED])
def test_each_motion_has_its_speed(speeds: Speeds | None, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[str, float]] = []
    for name in ("move_to", "move_linear"):
        plan = getattr(MotionPlanner, name)

        def spy(self: Any, *args: Any, _name: str = name, _plan: Any = plan, **options: Any) -> Any:
            asked.append((_name, options["speed"]))
            return _plan(self, *args, **options)

        monkeypatch.setattr(MotionPlanner, name, spy)
    arm = Arm(speeds=speeds)
    arm.manipulator.pick(CUBE)
    arm.manipulator.place(PLACE)
    arm.manipulator.try_retreat()
    arm.manipulator.try_go_home()
    free, carry, contact = {None: (1.0, 0.6, 0.3), FULL_SPEED: (1.0, 1.0, 1.0)}.get(
        speeds, (0.9, 0.7, 0.5)
    )
    assert asked == [
        *(("move_to", free), ("move_linear", contact), ("move_linear", carry)),
        *(("move_to", carry), ("move_linear", contact)),
        *(("move_linear", free), ("move_to", free)),
    ]


@pytest.mark.parametrize(
    ("offset", "lost"),
    [({"z": 0.039}, False), ({"z": 0.041}, True), ({"x": -0.041}, True), ({"y": 0.041}, True)],
)
def test_a_cube_4_cm_from_the_tool_is_not_held(offset: dict[str, float], lost: bool) -> None:
    arm = Arm(Mishap("it", 2.6, slip(**offset)))
    if lost:
        with pytest.raises(LostBody, match="cube_11 is not in the hand"):
            arm.manipulator.pick(CUBE)
    else:
        arm.manipulator.pick(CUBE)
    assert arm.manipulator.held == CUBE


def test_a_slip_in_the_hand_is_not_corrected_for(holding: Arm) -> None:
    holding.process.grip = holding.process.grip.translated(x=0.02)
    holding.manipulator.place(PLACE)
    off = np.subtract(holding.process.released[0][1].position, PLACE.position)
    assert np.linalg.norm(off) == pytest.approx(0.02, abs=1e-5)


def test_a_cube_lost_on_the_way_is_lost_before_it_would_be_placed(holding: Arm) -> None:
    holding.process.pending.append(Mishap("carry", 0.3, drop))
    holding.process.where.phase = "carry"
    with pytest.raises(LostBody):
        holding.manipulator.place(PLACE)
    assert [asked.phase for asked in holding.process.asked].count("carry") == 1  # it is not lowered


def test_it_looks_where_the_cube_is_now(arm: Arm) -> None:
    arm.put(CUBE, Pose.at(0.35, 0.05, 0.325, yaw=0.2))
    arm.manipulator.pick(CUBE)
    assert arm.tools[2].position == pytest.approx([0.35, 0.05, 0.325], abs=1e-4)


def test_of_equivalent_grasps_the_nearest_is_taken(arm: Arm) -> None:
    start = arm.manipulator.arm.copy()
    arm.manipulator.pick(CUBE)
    above = arm.process.asked[0].arguments["position"][-1, :7]
    assert np.abs(above - start).max() < np.pi / 2


def test_a_cube_beside_another_is_grasped_across(arm: Arm) -> None:
    """A neighbour 1 mm away leaves no room for a finger on two of the four sides."""
    x, y, z = arm.process.scene.body(CUBE).pose.position
    arm.put("cube_01", Pose.at(x, y + 0.051, z))
    arm.put("cube_02", Pose.at(x, y - 0.051, z))
    arm.manipulator.pick(CUBE)
    opening = arm.tools[1].rotation()[:, 1]
    assert np.abs(opening) == pytest.approx([1.0, 0.0, 0.0], abs=1e-3)


def test_the_fingers_may_touch_the_cube_that_they_grasp(arm: Arm) -> None:
    """It stands almost on an edge, 2 mm narrower than the open hand; two neighbours leave one way
    to it."""
    x, y, _ = arm.process.scene.body(CUBE).pose.position
    half = 0.5 / 2
    standing = Pose((x, y, 0.3355), (np.cos(half), np.sin(half), 0.0, 0.0))
    arm.put(CUBE, standing)
    arm.put("cube_01", Pose.at(x + 0.051, y, 0.325))
    arm.put("cube_02", Pose.at(x - 0.051, y, 0.325))
    arm.manipulator.pick(CUBE)
    assert np.abs(arm.tools[1].rotation()[:, 1]) == pytest.approx([0.0, 1.0, 0.0], abs=1e-3)


def test_what_cannot_be_grasped_says_why() -> None:
    walled = Arm()
    x, y, z = walled.process.scene.body(CUBE).pose.position
    for k, (dx, dy) in enumerate(((0.051, 0), (-0.051, 0), (0, 0.051), (0, -0.051)), start=1):
        walled.put(f"cube_0{k}", Pose.at(x + dx, y + dy, z))
    with pytest.raises(PlanningError, match=r"in collision: panda_\w*finger\w* and cube_0\d"):
        walled.manipulator.pick(CUBE)
    assert walled.manipulator.held is None
    far = Arm()
    far.put(CUBE, Pose.at(-2.0, 0.0, 0.025))
    with pytest.raises(PlanningError, match=r"unreachable: tool at \(-2\.000"):
        far.manipulator.pick(CUBE)
    with pytest.raises(PlanningError, match="unreachable: straight line to"):
        far.manipulator.pick("cube_12", way=(1.0, 0.0, 0.0))
    assert far.manipulator.recover() is None
    assert all(asked.kind == "wait" for asked in far.process.asked)  # nothing was moved


def test_recovering_without_the_cube_opens_the_hand_and_retreats() -> None:
    arm = Arm(Mishap("it", 2.6, drop))
    with pytest.raises(LostBody):
        arm.manipulator.pick(CUBE)
    before, at = len(arm.process.asked), arm.tools[-1]
    assert arm.manipulator.recover() is None
    assert arm.manipulator.held is None
    assert arm.fingers[before:] == [0.035, 0.035]
    assert positions(arm.tools[before:])[:, 2] == pytest.approx(
        [at.position[2], at.position[2] + 0.1], abs=1e-4
    )


def test_a_cube_that_cannot_be_put_back_is_let_go_where_it_is(arm: Arm) -> None:
    origin = arm.process.poses[CUBE]
    arm.manipulator.pick(CUBE)
    arm.put("cube_01", origin.translated(z=0.001))
    problem = arm.manipulator.recover()
    assert problem.startswith("could not put back: in collision: ")
    assert arm.manipulator.held is None
    (_, pose) = arm.process.released[0]
    assert pose.position[2] == pytest.approx(origin.position[2] + 0.1, abs=1e-4)


def test_recovering_leaves_a_cube_that_stands_too_near_to_plan_from(arm: Arm) -> None:
    manipulator = arm.manipulator
    over = arm.process.scene.body(CUBE).pose.translated(z=0.06)
    manipulator.go_to_pose(tool_over(over, 0.0), speed=0.5)
    x, y, z = manipulator.tool.position
    arm.put("cube_12", Pose.at(x, y + 0.085, z))  # in the air, beside a fingertip
    with pytest.raises(PlanningError, match="start in collision"):
        manipulator.pick("cube_03")
    assert manipulator.recover() is None
    assert manipulator.tool.position == pytest.approx([x, y, z + 0.10], abs=1e-4)
    manipulator.pick("cube_03")


def test_a_retreat_may_touch_the_cube_it_let_go_but_nothing_else(holding: Arm) -> None:
    holding.manipulator.place(PLACE)
    move(CUBE, tilt=0.3)(holding.process)  # it leans against the fingers
    holding.world.wait(0.1)
    assert holding.manipulator.try_retreat() is None
    other = Arm()
    other.manipulator.pick(CUBE)
    other.manipulator.place(PLACE)
    other.put("cube_01", Pose.at(0.5, 0.0, 0.52))
    problem = other.manipulator.try_retreat()
    assert problem.startswith("could not retreat: straight line blocked: ")
    assert "cube_01" in problem


def test_a_motion_starts_from_the_commands_not_from_where_the_arm_sags(holding: Arm) -> None:
    for before, after in zip(holding.process.asked, holding.process.asked[1:], strict=False):
        ends, starts = before.arguments["position"][-1], after.arguments["position"][0]
        assert starts == pytest.approx(ends, abs=1e-9)


def test_planning_is_measured_as_planning(arm: Arm) -> None:
    built = arm.world.stopwatch.seconds["plan"]
    assert built > 0
    arm.manipulator.pick(CUBE)
    assert arm.world.stopwatch.seconds["plan"] > built


def test_a_scene_without_a_robot_has_no_manipulator() -> None:
    scene = Scene("bare", (Box("it", (0.1, 0.1, 0.1), Pose.at(0, 0, 0.05), mass=0.1),))
    world = ScriptedWorld(ScriptedProcess(), scene)
    with pytest.raises(ValueError, match="scene 'bare' has no robot"):
        Manipulator(world, np.random.default_rng(1))


def test_a_task_moves_the_arm_with_verbs_of_its_own(arm: Arm) -> None:
    """A push: the closed hand beside a cube, straight through where it stands."""
    hand, (x, y, _) = arm.manipulator, arm.process.scene.body(CUBE).pose.position
    beside = tool_over(Pose.at(x - 0.07, y, 0.37), 0.0)
    hand.go_to_pose(tool_over(Pose.at(x - 0.07, y, 0.45), 0.0), speed=0.5)
    hand.close_hand()
    hand.move_straight(beside, speed=0.3, ignored=("cube_04",))
    assert hand.tool.position == pytest.approx(beside.position, abs=1e-5)
    with pytest.raises(PlanningError, match="blocked"):
        hand.move_straight(beside.translated(x=0.06, z=-0.04), speed=0.3)
    pushed = beside.translated(x=0.06, z=-0.04)
    hand.move_straight(pushed, speed=0.3, ignored=(CUBE, "cube_04"))
    assert arm.tools[-1].position == pytest.approx(pushed.position, abs=1e-4)
    assert arm.fingers == [0.035, 0.0, 0.0, 0.0]
    assert hand.held is None
    hand.open_hand()
    assert arm.fingers[-1] == 0.035


def test_a_closed_hand_is_planned_for_as_it_is(arm: Arm) -> None:
    """Its fingers pass where those of an open hand would touch."""
    x, y, _ = arm.process.scene.body(CUBE).pose.position
    between = tool_over(Pose.at(x, y + 0.05, 0.33), 0.0)
    arm.manipulator.go_to_pose(between.translated(z=0.12), speed=0.5)
    with pytest.raises(PlanningError, match="blocked"):
        arm.manipulator.move_straight(between, speed=0.3)
    arm.manipulator.close_hand()
    arm.manipulator.move_straight(between, speed=0.3)


def test_a_grasp_of_ones_own_is_held_and_planned_for(arm: Arm) -> None:
    hand, cube = arm.manipulator, arm.process.scene.body(CUBE).pose
    hand.go_to_pose(tool_over(cube.translated(z=0.1), 0.0), speed=0.5)
    hand.move_straight(tool_over(cube, 0.0), speed=0.3, ignored=(CUBE,))
    hand.close_hand(around=CUBE)
    assert hand.held == CUBE
    hand.move_straight(hand.tool.translated(z=0.2), speed=0.3, ignored=(CUBE,))
    hand.check_held()
    assert arm.process.poses[CUBE].position[2] == pytest.approx(cube.position[2] + 0.2, abs=1e-4)
    hand.place(PLACE)
    assert arm.process.poses[CUBE].position == pytest.approx([0.5, 0.0, 0.325], abs=1e-4)
    with pytest.raises(LostBody):
        hand.check_held()


def test_a_trajectory_of_ones_own_ends_where_the_next_motion_begins(arm: Arm) -> None:
    start = arm.world.joints[0]
    goal = start + np.array([0.1, 0, 0, 0, 0, 0, 0, -0.01, -0.01])
    rows = start + np.linspace(0.0, 1.0, 101)[:, None] * (goal - start)
    motion = arm.manipulator.follow(Trajectory(0.01, rows, 0 * rows, 0 * rows), log_period=0.1)
    assert len(motion) == 10
    assert arm.manipulator.arm == pytest.approx(goal[:7])
    assert arm.manipulator.fingers == pytest.approx(goal[-1])
    arm.manipulator.go_to(start[:7], speed=0.5)
    assert arm.process.asked[-1].arguments["position"][0] == pytest.approx(goal)
