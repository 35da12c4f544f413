"""The policies of `suites/policies`: what they are drawn from, and that a seed decides all."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from pytest_simbench.suites import test_transfer as suite
from pytest_simbench.suites.policies import picking, pushing, train

from pytest_simbench.motion.kinematics import Servo
from pytest_simbench.records.tuned_on import FIRST_SEED
from pytest_simbench.scene import FloatArray, Pose
from pytest_simbench.scene.policy import Command, Observation
from pytest_simbench.tasks import GoalTask, Jitter

MODULES = {"pushing": pushing, "picking": picking}
SHIPPED = [(task, name) for task, module in MODULES.items() for name in module.policies]


def commands(policy: Any, task: GoalTask, seed: int) -> FloatArray:
    """Where a policy sends the tool, which gets there at once, in a world where nothing moves."""
    scene = task.scene(10_001, Jitter())
    servo, robot = Servo(scene), scene.robot
    position = robot.column("initial_position")
    bodies = np.array([np.r_[b.pose.as_array(), np.zeros(6)] for b in scene.free_bodies])
    names = tuple(body.name for body in scene.free_bodies)
    policy.reset(seed)
    found = []
    for look in range(30):
        seen = Observation(look / policy.rate, position, 0 * position, np.zeros((3, len(position))),
                           bodies, names, task.goal(10_001), kinematics=servo)  # fmt: skip
        command = Command.of(policy.act(seen))
        if command.tool is not None:
            position = servo.towards(position, command.tool, 1 / policy.rate)
        found.append((servo.tool_pose(position).position, command.gripper or 0.0))
    return np.array([[*place, width] for place, width in found])


@pytest.mark.parametrize(("task", "name"), SHIPPED)
def test_a_seed_decides_what_a_policy_does(task: str, name: str) -> None:
    policy = MODULES[task].policies[name]
    once, again, other = (commands(policy, suite.TASKS[task](policy), seed) for seed in (1, 1, 2))
    assert policy.task == task
    assert np.array_equal(once, again)
    assert np.array_equal(once, other) is (name == "limp")
    assert np.ptp(once[:, :3], axis=0).max() > 0.1 or name == "limp"


def test_numbers_lie_where_training_looks_for_them_and_tell_where_they_were_found() -> None:
    for module in MODULES.values():
        for name, found in module.TRAINED.items():
            assert found["sim"] == name.split("-")[0]
            first, last = found["seeds"]
            assert train.FIRST <= first < last
            bounds = module.policies[name].bounds.values()
            for number, (low, high) in zip(found["numbers"], bounds, strict=True):
                assert low <= number <= high
    assert FIRST_SEED + 100_000 < train.FIRST  # no profile and no published run has these


def test_what_a_policy_sees_is_off_by_what_its_page_says() -> None:
    policy = pushing.policies["scripted"]
    policy.numbers["smoothing"], before = 1.0, policy.numbers["smoothing"]
    at = np.array([[0.5, 0.1, 0.02, 1.0, *np.zeros(9)]])
    seen = Observation(0.0, np.zeros(9), np.zeros(9), np.zeros((3, 9)), at, ("block",), Pose())
    looks = []
    for seed in range(200):
        policy.reset(seed)
        looks.append([policy.look(seen) - at[0, :2] for _ in range(20)])
    policy.numbers["smoothing"] = before
    offsets = np.mean(looks, axis=1)
    assert np.std(offsets) == pytest.approx(0.005, rel=0.1)
    assert np.std(looks - offsets[:, None]) == pytest.approx(0.002, rel=0.1)


def test_a_delay_is_in_periods_of_a_policy_that_says_no_rate() -> None:
    asked: list[GoalTask] = []
    suite.test_pushing_with_delay(asked.append, SimpleNamespace(act=print), "late2")
    assert asked[0].command_latency == 0.04  # of 50 Hz, at which it is asked


@pytest.mark.engine
def test_a_training_of_one_generation(capsys: pytest.CaptureFixture[str]) -> None:
    """The smallest, on one engine: it finds numbers within their bounds."""
    train.main(["pushing", "--sim=mujoco", "--population=5", "--generations=1", "--episodes=1"])
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("mujoco-0 generation 1: best [")
    numbers = map(float, re.findall(r"[\d.]+", lines[-1]))
    bounds = pushing.Push.bounds.values()
    assert all(low <= n <= high for n, (low, high) in zip(numbers, bounds, strict=True))
