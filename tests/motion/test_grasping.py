"""How hands grasp, and which of several equivalent poses an arm takes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_simbench.motion import grasping as grasps
from pytest_simbench.motion.collision import PlanningScene
from pytest_simbench.motion.errors import PlanningError
from pytest_simbench.motion.grasping import CLEARANCE, GRASP_LINK, choose, grasp_of, grasping
from pytest_simbench.motion.kinematics import straight_line, top_down_grasps
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.registry import find
from pytest_simbench.scene import FloatArray, Pose, Scene
from pytest_simbench.tasks import Stacking
from pytest_simbench.tasks.base import Jitter

SO101 = find("so101")
JAWS = PlanningScene(RobotModel(SO101), Scene("jaws", (), SO101))


def test_parallel_fingers_stay_as_they_are() -> None:
    robot = find("ur5")
    assert grasping(robot, 0.05, 1.0) is robot
    grasp = grasp_of(robot, 0.05, 1.0)
    assert (grasp.touching, grasp.beside) == (0.025, 0.0)


@settings(max_examples=5)
@given(width=st.floats(0.012, 0.035))
def test_a_jaw_touches_a_cube_that_the_fixed_one_touches(width: float) -> None:
    robot = grasping(SO101, width, width / 0.05)
    grasp = grasp_of(robot, width, width / 0.05)
    assert robot.tool_frame == GRASP_LINK
    middle = RobotModel(robot).tool_pose(robot.column("initial_position")[:5])
    face = RobotModel(SO101).tool_pose(SO101.column("initial_position")[:5])
    assert (face.inverse() * middle).position == pytest.approx((0.0, width / 2, 0.0), abs=1e-9)
    beside = grasp.beside
    assert beside == pytest.approx(CLEARANCE * width / 0.05)
    assert JAWS.gap(grasp.touching, width / 2) == pytest.approx(width, abs=1e-6)
    opened = robot.gripper.opened
    assert JAWS.gap(opened, width / 2) == pytest.approx(width + 2 * beside, abs=1e-6)
    assert robot.joints[-1].initial_position == opened
    assert robot.limits == SO101.limits


def test_the_faces_of_the_so101s_jaws_are_those_of_the_meshes() -> None:
    """Steps, parallel to each other at 0: those of the fixed jaw lie at 0, -2.0, -3.7, -5.4 and
    -7.1 mm, those of the other one at 15.8, 17.8 and 19.8 mm. Each slice has one."""
    fixed, moving = slices(JAWS.model.arm), slices(JAWS.model.arm + 1)
    faces = sorted(1e3 * float(part[:, 1].max()) for part in fixed)
    assert faces[:5] == pytest.approx([-7.1, -5.4, -3.7, -2.0, 0.0], abs=0.1)
    faces = sorted(1e3 * float(part[:, 1].min()) for part in moving)
    assert faces[0] == pytest.approx(15.8, abs=0.05)
    assert faces[1:] == pytest.approx([17.8, 18.1, 19.8], abs=0.05)  # 18.1: where it hangs


def slices(joint: int) -> list[FloatArray]:
    """Corners of the shapes of a link in the tool frame at 0 rad, (n, 3) each."""
    model, geometry = JAWS.model, JAWS._geometry
    q = np.zeros(len(model.robot.joints))
    pin.updateGeometryPlacements(model.pin, model.data, geometry, JAWS._exact, q)
    tool = pin.updateFramePlacement(model.pin, model.data, model.tool)
    found = []
    for index in JAWS._links:
        shape = geometry.geometryObjects[index]
        if shape.parentJoint == joint:
            placed = tool.actInv(JAWS._exact.oMg[index])
            found.append(
                np.asarray(shape.geometry.points()) @ placed.rotation.T + placed.translation
            )
    return found


def test_what_the_jaw_is_too_narrow_for_is_left_to_be_told() -> None:
    narrow = replace(SO101, gripper=replace(SO101.gripper, opened=0.0))
    assert grasping(narrow, 0.02, 0.4) is narrow
    wide = grasping(SO101, 0.02, 0.4, wide=True)
    assert wide.gripper.opened == 1.0 == wide.joints[-1].initial_position
    assert np.isinf(JAWS.gap(1.0, 0.01))


def choices(name: str) -> list[str]:
    """What is wrong with the cubes of stacking that cannot be taken."""
    robot = find(name)
    scene = Stacking(robot=robot).scene(2022, Jitter())
    model = RobotModel(robot)
    planning = PlanningScene(model, scene)
    home = model.home
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
    monkeypatch.setattr(grasps, "FURTHER_RESTARTS", 0)
    problems = choices("ur5")
    assert any(problem.startswith("in collision: upper_arm") for problem in problems)


def test_from_above_the_hand_can_go_down_and_on_as_far_as_is_asked() -> None:
    robot = find("panda")
    model, home = RobotModel(robot), robot.column("initial_position")[:7]
    planning, rng = PlanningScene(model, Scene("free", (), robot)), np.random.default_rng(0)
    tools = top_down_grasps(Pose.at(0.5, 0.0, 0.3))
    found = choose(planning, tools, 0.1, home, home, rng, way=(0.0, 0.3, 0.0))
    aside = straight_line(model, found.above, found.tool.translated(y=0.3, z=0.1))
    assert model.tool_pose(aside[-1]).position == pytest.approx((0.5, 0.3, 0.4), abs=1e-5)
    with pytest.raises(PlanningError, match=r"straight line to \(0.5, \d"):
        choose(planning, tools, 0.1, home, home, rng, way=(0.0, 1.3, 0.0))
    low = top_down_grasps(Pose.at(0.5, 0.0, 0.015))  # tips are nearer to the ground than a margin
    found = choose(planning, low, 0.1, home, home, rng)
    assert model.tool_pose(found.above).position == pytest.approx((0.5, 0.0, 0.115), abs=1e-5)
    with pytest.raises(PlanningError, match=r"^in collision: panda_\w+ and ground$"):
        choose(planning, low, 0.0, home, home, rng)
