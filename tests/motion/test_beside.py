"""A thing beside the arm: they collide, the arm's model is without it, plans go around it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pytest_simbench.client.world import World
from pytest_simbench.laws.mechanisms import Part, mechanism
from pytest_simbench.motion.beside import with_thing
from pytest_simbench.motion.collision import PlanningScene
from pytest_simbench.motion.kinematics import Servo, inverse_kinematics, tool_over
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.panda import panda
from pytest_simbench.motion.planning import MotionPlanner
from pytest_simbench.parity.quantities import expected_quantities
from pytest_simbench.scene import FloatArray, Pose, Robot, Scene
from pytest_simbench.scene.robot import Closure, Coupling
from pytest_simbench.simulator import DescriptionError
from pytest_simbench.simulator.registry import settings_of
from tests.tasks.scripted import ScriptedProcess

BASE = Pose.at(0.1, -0.1, 0.2, yaw=0.4)
BLOCK, BESIDE = (0.1, 0.1, 0.1), Pose.at(0.5, 0.3, 0.3)


def block(name: str = "a_slide", **more: object) -> Robot:
    """A block that slides along y. Pinocchio sorts joints by name: this one comes first."""
    part = Part(name, (0.0, 1.0, 0.0), slides=True, shape=BLOCK, start=-0.3)
    return replace(mechanism("block", part, base=BESIDE), **more)


SCENE = with_thing(Scene("beside", robot=panda(base=BASE)), block())
MODEL = RobotModel(SCENE.robot)  # type: ignore[arg-type]
READY = MODEL.robot.column("initial_position")[:7]


def test_arm_and_thing_collide_and_neither_with_itself() -> None:
    touches = {
        name.removeprefix("link/").removesuffix("/touches"): value[2]
        for name, value in expected_quantities(SCENE, settings_of("mujoco", "tuned", {})).items()
        if name.endswith("/touches")
    }
    arms = len(touches) - 1
    assert touches.pop("a_slide link") == pytest.approx((arms - 1) / arms)  # but for the foot
    assert touches.pop("base") == 0.0
    assert set(touches.values()) == {1 / arms}


@pytest.mark.parametrize("name", ["a_slide", "z_slide"])
def test_the_model_is_that_of_the_arm(name: str) -> None:
    scene = with_thing(Scene("beside", robot=panda(base=BASE)), block(name))
    alone, beside = RobotModel(panda(base=BASE)), RobotModel(scene.robot)  # type: ignore[arg-type]
    assert list(beside.pin.names) == list(alone.pin.names)
    assert beside.tool_pose(READY) == alone.tool_pose(READY)
    assert beside.robot.arm_joints == alone.robot.arm_joints
    assert Robot.from_wire(beside.robot.to_wire()).beside == (name,)


def test_loops_and_couplings_of_both_stay() -> None:
    pair, loop = Coupling("b", "a", 2.0), Closure("a link", "b link")
    lead = Coupling("panda_finger_joint2", "panda_finger_joint1", 1.0)
    parts = [Part(name, (0.0, 1.0, 0.0), slides=True, shape=BLOCK) for name in "ab"]
    both = replace(mechanism("two", *parts, base=BESIDE), couplings=(pair,), closures=(loop,))
    first = with_thing(Scene("s", robot=replace(panda(), couplings=(lead,))), both)
    robot = first.arm
    assert (robot.name, robot.couplings, robot.closures) == ("panda_and_two", (lead, pair), (loop,))
    assert robot.joint_names == (*panda().joint_names, *robot.beside) != panda().joint_names
    near, far = (("link/base", f"link/panda_link{number}") for number in (1, 2))
    assert (near in first.apart, far in first.apart, robot.self_collide) == (False, True, True)


def over(x: float, y: float) -> FloatArray:
    return inverse_kinematics(MODEL, tool_over(Pose.at(x, y, 0.3), 0.0), READY)


def test_plans_go_around_where_it_is_now() -> None:
    planning = PlanningScene(MODEL, SCENE)
    at, aside = over(0.5, 0.0), over(0.5, 0.3)
    assert planning.collision(at) is not None
    assert planning.collision(at, ignored=("a_slide link",), margin=False) is None
    assert planning.collision(aside) is None
    planning.update({}, np.array([*READY, 0.035, 0.035, 0.0]))
    assert planning.collision(at) is None
    assert planning.collision(aside) is not None
    with pytest.raises(KeyError):
        planning.collision(at, ignored=("no such link",))


def test_no_plan_and_no_policy_moves_it() -> None:
    planner = MotionPlanner(MODEL, PlanningScene(MODEL, SCENE), np.random.default_rng(0), (0, 0, 0))
    plan = planner.move_to(READY, over(0.5, 0.3), 0.035)
    assert (plan.position[:, -1] == -0.3).all()
    assert (plan.position[:, 7:9] == 0.035).all()
    assert not plan.velocity[:, -1].any()
    assert not plan.effort[:, 7:].any()
    world = World(ScriptedProcess(), SCENE, kinematics=Servo)  # type: ignore[arg-type]
    alone = Servo(Scene("alone", robot=panda(base=BASE)))
    effort = Servo(SCENE).holding_effort(world.joints[0])
    assert effort == pytest.approx([*alone.holding_effort(world.joints[0, :9]), 0.0])


@pytest.mark.parametrize(
    ("scene", "thing", "what"),
    [
        (Scene("bare"), block(), "scene 'bare' has no robot to put 'block' beside"),
        (Scene("two", robot=panda()), block("panda_joint1"), "both have the joint 'panda_joint1'"),
        (
            Scene("fixed", robot=panda()),
            mechanism("case", Part("lid", (0.0, 1.0, 0.0)), shape=BLOCK),
            "the arm would pass through what is fixed of 'case'",
        ),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_what_cannot_stand_there(scene: Scene, thing: Robot, what: str) -> None:
    with pytest.raises(DescriptionError, match=what):
        with_thing(scene, thing)
