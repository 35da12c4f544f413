"""Closed loops as plain data: rhythms, commands, the set points that follow."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.ground.errors import PolicyError
from pytest_simbench.motion.kinematics import FASTEST, Servo
from pytest_simbench.motion.panda import panda
from pytest_simbench.scene import Box, Gripper, Pose, Scene
from pytest_simbench.scene import policy as module
from pytest_simbench.scene.policy import Command, Function, LoopError, Policy, Rhythm, as_policy
from pytest_simbench.scene.set_points import SetPoints, Sight, _changed, written

CUBE = Box("cube", (0.05, 0.05, 0.05), Pose.at(0.5, 0.0, 0.5), mass=0.1)
SCENE = Scene("one", (CUBE,), panda())
START = panda().column("initial_position")
SERVO = Servo(SCENE)


def points(servo: Servo | None = SERVO, period: float = 0.1) -> SetPoints:
    return SetPoints(panda(), START, np.zeros(9), period, servo)


@given(st.integers(1, 400), st.sampled_from([0.001, 0.002, 0.004, 1 / 240]))
def test_a_rhythm_of_whole_steps_is_told_in_steps(steps: int, timestep: float) -> None:
    rate = 1 / (steps * timestep)
    assert Rhythm(rate, 3 * timestep, 2 / rate).steps(timestep) == (steps, 3, 2)


@pytest.mark.parametrize(
    ("rhythm", "told"),
    [
        (Rhythm(50.0), "no multiple of the time step of 4.167 ms; choose 60 Hz or 48 Hz"),
        (Rhythm(10.0, 0.01), "time step of 0.004166667 s; choose 0.008333333 s or 0.0125 s"),
        (Rhythm(10.0, 0.0, 0.15), "the policy's period of 0.1 s; choose 0.1 s or 0.2 s"),
    ],
)
def test_another_is_refused(rhythm: Rhythm, told: str) -> None:
    with pytest.raises(LoopError, match=told):
        rhythm.steps(1 / 240)


@pytest.mark.parametrize(
    "given",
    [{"rate": 0.0}, {"rate": math.nan}, {"command_latency": -1.0}, {"observation_delay": -1.0}],
)
def test_so_is_what_is_no_rhythm(given: dict[str, float]) -> None:
    with pytest.raises(LoopError):
        Rhythm(**{"rate": 10.0, **given})


def test_what_is_a_policy() -> None:
    def nothing(seen: object) -> None:
        return None

    made = as_policy(nothing, 20.0)
    assert isinstance(made, Function)
    assert (made.name, made.rate) == ("nothing", 20.0)
    assert as_policy(made) is made
    for kind, name in ((type("Push", (), {}), "Push"), (type("Push", (), {"name": "p"}), "p")):
        assert module.name_of(kind()) == name
    assert (module.name_of(made), module.name_of(nothing)) == ("nothing", "nothing")
    assert (as_policy(nothing).rate, Function(partial(nothing)).name) == (Policy.rate, "function")
    for wrong in (3, "act", Policy):
        with pytest.raises(LoopError, match="is no policy"):
            as_policy(wrong)


def test_what_is_not_commanded_stays() -> None:
    at = points()
    at.after(None)
    assert np.array_equal(at.position, START)
    at.after(Command(gripper=0.02))
    assert np.array_equal(at.position[:7], START[:7])
    assert at.position[7:].tolist() == [0.01, 0.01]
    at.after(np.zeros(7))
    assert at.position.tolist() == [0.0] * 7 + [0.01, 0.01]
    assert np.array_equal(at.effort, SERVO.holding_effort(at.position))
    assert np.array_equal(points().effort, SERVO.holding_effort(START))
    at.after(np.full(9, 0.02))
    assert at.position.tolist() == [0.02] * 9


def test_a_velocity_moves_the_set_point_on() -> None:
    at = points(period=0.1)
    for _ in range(3):
        at.after(Command(velocity=np.full(7, 0.2)))
    np.testing.assert_allclose(at.position[:7] - START[:7], 0.06)
    whole = SetPoints(panda(), np.zeros(9, int), np.zeros(9, int), 0.1)
    whole.after(Command(velocity=np.full(7, 0.2)))
    assert whole.position.tolist() == pytest.approx([0.02] * 7 + [0.0] * 2)
    assert whole.effort.dtype == float


@pytest.mark.parametrize(
    "command",
    [
        Command(velocity=np.full(7, 0.2)), Command(tool_change=np.full(6, 0.01)),
        Command(tool=Pose((0.45, 0.3, 0.3), (0.0, 1.0, 0.0, 0.0))),
    ],
)  # fmt: skip
def test_a_velocity_and_a_way_of_the_tool_hold_for_one_period(command: Command) -> None:
    at = points()
    at.after(command)
    there = at.position[:7].copy()
    assert not np.array_equal(there, START[:7])
    for answer in (None, Command(gripper=0.02)):
        at.after(answer)
        assert np.array_equal(at.position[:7], there)


def test_the_arm_is_held_against_gravity() -> None:
    at = points()
    model = SERVO.model
    still = np.zeros((1, 9))
    held = model.inverse_dynamics(np.array([0, 0, -9.81]), START[None], still, still)[0]
    np.testing.assert_allclose(at.effort[:7], held[:7], rtol=1e-3, atol=1e-9)
    light = [replace(joint, gravity=0.0) for joint in panda().joints]
    weightless = Servo(replace(SCENE, robot=replace(panda(), joints=tuple(light))))
    assert not weightless.holding_effort(START).any()
    assert at.effort[7:].tolist() == [0.0, 0.0]
    at.after(Command(position=START[:7], effort=np.ones(7)))
    assert at.effort.tolist() == [1.0] * 7 + [0.0, 0.0]


def test_a_tool_is_moved_and_turned_by_all_that_a_change_says() -> None:
    tool = _changed(Pose.at(1.0, 2.0, 3.0), np.array([0.1, 0.2, 0.3, 2.5, 0.0, 0.0]))
    wanted = [1.1, 2.2, 3.3, math.cos(1.25), math.sin(1.25), 0.0, 0.0]
    assert tool.as_array() == pytest.approx(wanted)


@given(st.lists(st.floats(-0.02, 0.02), min_size=6, max_size=6))
def test_the_tool_goes_by_what_it_is_told(change: list[float]) -> None:
    at = points()
    before = SERVO.tool_pose(at.position)
    at.after(Command(tool_change=change))
    after = SERVO.tool_pose(at.position)
    np.testing.assert_allclose(np.subtract(after.position, before.position), change[:3], atol=1e-5)
    turn = after * before.inverse()
    w, vector = turn.quaternion[0], np.array(turn.quaternion[1:])
    angle = 2 * math.atan2(float(np.linalg.norm(vector)), w)
    axis = vector / max(1e-12, float(np.linalg.norm(vector)))
    np.testing.assert_allclose(angle * axis, change[3:], atol=1e-5)


def test_a_far_pose_is_come_near_to_no_faster_than_the_limits() -> None:
    at, goal = points(period=0.02), Pose((0.45, 0.3, 0.3), (0.0, 1.0, 0.0, 0.0))
    fastest = np.array(panda().limits.velocity)  # type: ignore[union-attr]
    for _ in range(200):
        before = at.position.copy()
        at.after(Command(tool=goal))
        assert (np.abs(at.position - before)[:7] <= fastest * 0.02 * 1.0001).all()
        way = [SERVO.tool_pose(row).position for row in (before, at.position)]
        assert np.linalg.norm(np.subtract(*way)) <= 1.1 * FASTEST * 0.02
    np.testing.assert_allclose(SERVO.tool_pose(at.position).position, goal.position, atol=1e-4)


def test_out_of_reach_the_joints_stay_within_their_limits() -> None:
    at = points()
    for _ in range(100):
        at.after(Command(tool=Pose((2.0, 1.0, 0.1))))
    assert (at.position[:7] >= SERVO.model.lower).all()
    assert (at.position[:7] <= SERVO.model.upper).all()


@pytest.mark.parametrize(
    ("answer", "told"),
    [
        (np.zeros(8), r"answers position of shape \(8,\); the arm has 7 joints, and 9 with its"),
        ("left", "answers position='left', which is no number"),
        (np.full(7, 1j), "which is no number"),
        (Command(gripper=0.02 + 0j), "which is no number"),  # type: ignore[arg-type]
        (np.full(7, np.nan), "position with a number that is not finite"),
        (Command(velocity=np.full(7, 1e300)), "velocity with a number that is not finite, or"),
        (Command(tool_change=[1e300] * 6), "tool_change with a number that is not finite"),
        (Command(tool=Pose((math.nan, 0.0, 0.0))), "the position of the tool is nan; it must be"),
        (Command(tool=Pose(quaternion=(1.0, 1.0, 0.0, 0.0))), "quaternion of the tool has the len"),
        (Command(gripper=[0.01, 0.02]), r"gripper of shape \(2,\), not one number"),  # type: ignore[arg-type]
        (Command(gripper="wide"), "answers gripper='wide', which is no number"),  # type: ignore[arg-type]
        (Command(position=START[:7], velocity=START[:7]), "commands position and velocity at once"),
        (Command(tool=(1, 2, 3)), "which is no Pose"),  # type: ignore[arg-type]
        (Command(tool_change=(1, 2, 3)), r"a tool_change of shape \(3,\), not \(6,\)"),
        (Command(effort=np.zeros(7)), "commands efforts alone, and the joints have drives"),
    ],
)
def test_what_is_no_command_is_told(answer: Any, told: str) -> None:
    with pytest.raises(PolicyError, match=told):
        points().after(answer)


def test_motors_take_efforts_alone() -> None:
    at = SetPoints(panda().as_motors(), START, np.full(9, 2.0), 0.1)
    assert at.effort.tolist() == [2.0] * 9
    at.after(Command(effort=np.arange(7.0)))
    assert at.effort.tolist() == [*range(7), 0.0, 0.0]
    at.after(Command(gripper=0.03))  # without a model of the hand each finger goes half the way
    assert at.position[7:].tolist() == [0.015, 0.015]
    at.after(Command(position=[*range(9)], effort=np.zeros(7)))  # moves the fingers
    for answer in (Command(tool_change=np.zeros(6)), Command(velocity=np.zeros(9)), np.zeros(7)):
        with pytest.raises(PolicyError, match="alone, and the arm's joints are motors, which push"):
            at.after(answer)


def test_a_robot_without_a_hand_is_moved_by_all_its_joints() -> None:
    bare = replace(panda(), gripper=Gripper((), 0.0, 0.0, 0.0), limits=None, swing=None)
    at = SetPoints(bare, START, START, 0.1)
    at.after(Command(position=np.arange(9.0)))
    assert at.position.tolist() == [*range(9)]
    with pytest.raises(PolicyError, match="moves the gripper; robot 'panda' has none"):
        at.after(Command(gripper=0.1))


def test_a_hand_without_an_arm_is_moved_by_its_fingers() -> None:
    """It was told that the joints of its arm are motors."""
    hand = replace(panda(), joints=panda().joints[7:], limits=None, swing=None)
    at = SetPoints(hand, np.zeros(2), np.zeros(2), 0.1)
    at.after(np.array([0.01, 0.02]))
    assert at.position.tolist() == [0.01, 0.02]


def test_without_a_model_the_tool_is_refused() -> None:
    for answer in (Command(tool_change=np.zeros(6)), Command(tool=Pose())):
        with pytest.raises(PolicyError, match="inside the worker"):
            points(None).after(answer)
    seen = Sight(SCENE).seen(0.0, np.zeros((2, 9)), np.zeros((3, 9)), np.zeros((1, 13)))
    with pytest.raises(PolicyError, match="a policy does not see the pose of the tool"):
        _ = seen.tool


def test_what_is_seen() -> None:
    rng = np.random.default_rng(0)
    joints, told, bodies = (
        rng.normal(size=(2, 9)),
        rng.normal(size=(3, 9)),
        rng.normal(size=(2, 13)),
    )
    bodies_of = CUBE, replace(CUBE, name="other", pose=Pose.at(0.5, 0.2, 0.5))
    sight = Sight(replace(SCENE, bodies=bodies_of), SERVO, Pose.at(1, 2, 3))
    state = np.frombuffer(written(0.5, joints, told, bodies))
    assert len(state) == sight.numbers
    seen = sight.read(state)
    assert seen.time == 0.5
    for found, right in (
        (seen.position, joints[0]), (seen.velocity, joints[1]), (seen.told, told),
        (seen.bodies, bodies), (seen.twist("other"), bodies[1, 7:]),
    ):  # fmt: skip
        assert np.array_equal(found, right)
    assert seen.goal == Pose.at(1, 2, 3)
    assert sight.read(state, picture=told).picture is told
    assert seen.pose("cube") == Pose.from_array(bodies[0])
    assert seen.tool == SERVO.tool_pose(joints[0])
    with pytest.raises(PolicyError, match="'ball'; the free bodies are: cube, other"):
        seen.pose("ball")


def test_efforts_are_those_of_the_drives() -> None:
    joint = panda().joints[0]
    joints, told = np.zeros((2, 9)), np.zeros((3, 9))
    joints[:, 0], told[:, 0] = (0.1, 0.2), (0.105, 0.3, 1.0)
    effort = Sight(SCENE).seen(0.0, joints, told, np.zeros((1, 13))).effort
    assert effort[0] == pytest.approx(joint.stiffness * 0.005 + joint.damping * 0.1 + 1.0)
    told[0, 0] = 100.0
    assert Sight(SCENE).seen(0.0, joints, told, np.zeros((1, 13))).effort[0] == joint.effort_limit


def test_without_a_robot_there_is_nothing_to_move() -> None:
    with pytest.raises(LoopError, match="'one' has no robot that a policy could move"):
        Sight(replace(SCENE, robot=None))
