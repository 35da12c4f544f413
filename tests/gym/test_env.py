"""Environments: what Gymnasium demands, what an episode is, how workers end."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import gymnasium
import numpy as np
import psutil
import pytest
from gymnasium.error import ClosedEnvironmentError, InvalidAction, ResetNeeded, UnsupportedMode
from gymnasium.utils.env_checker import check_env

import pytest_simbench
from pytest_simbench.cli.values import BadInput
from pytest_simbench.client.closed_loop import Looking
from pytest_simbench.client.environments import missing
from pytest_simbench.client.errors import Unavailable
from pytest_simbench.gym import IDS, making
from pytest_simbench.gym.env import checked
from pytest_simbench.gym.making import RATE, make, make_vec
from pytest_simbench.motion.panda import panda
from pytest_simbench.scene import Scene
from pytest_simbench.scene.policy import Rhythm
from pytest_simbench.simulator import Capability
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.tasks.base import Jitter
from pytest_simbench.tasks.goals import PushingToGoal, Reaching
from tests.conftest import ADAPTERS, able_to, workers

REAL = np.dtype("float64")
HOW = "headless", "tuned", "p", "pushing_to_goal"
SHORT = {"seconds": 0.4}


@contextmanager
def made(task: Any = "reaching", simulator: str = "mujoco", **options: Any) -> Iterator[Any]:
    """An environment, of which no process is left."""
    before = workers()
    env = make(task, simulator, **options)
    yield env
    env.close()
    assert not workers() - before


@pytest.mark.engine
@pytest.mark.parametrize("name", ADAPTERS)
def test_gymnasiums_checker_is_content(name: str) -> None:
    """It makes the environment again for its pictures: that takes long, and is asked of two."""
    if absent := missing(adapter(name).info):
        pytest.skip(absent)
    whole = name in ("mujoco", "pybullet")
    env = gymnasium.make("simbench/PickAndPlace-v0", simulator=name).unwrapped
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", ".*is (-)?infinity.*")  # as of Gymnasium's own arms
        try:
            check_env(env, skip_render_check=not whole, skip_close_check=not whole)
        except Unavailable as reason:
            pytest.skip(str(reason))
        finally:
            env.close()


def played(env: Any, seed: int, actions: Any) -> list[Any]:
    """Everything that an episode gives."""
    seen, info = env.reset(seed=seed)
    steps = [(seen, 0.0, False, False, info)]
    for action in actions:
        steps.append(env.step(action))
    return steps


def flat(steps: list[Any]) -> np.ndarray:
    rows = [np.concatenate([*seen.values(), [reward]]) for seen, reward, *_ in steps]
    return np.array(rows)


@pytest.mark.engine
def test_a_seed_and_the_actions_decide_everything() -> None:
    with made("pushing", rate=20.0, seconds=2.0) as env:
        actions = np.random.default_rng(1).uniform(-1, 1, (10, *env.action_space.shape))
        first = flat(played(env, 7, actions))
        other = flat(played(env, 8, actions))
        np.testing.assert_array_equal(flat(played(env, 7, actions)), first)
    with made("pushing", rate=20.0, seconds=2.0) as env:
        np.testing.assert_array_equal(flat(played(env, 7, actions)), first)
    assert (first[0] != other[0]).any()


@pytest.mark.engine
@pytest.mark.parametrize("reward", ["dense", "sparse"])
def test_an_episode_ends_once_the_goal_is_held(reward: str) -> None:
    """5 cm a step at most, towards the goal."""
    task = Reaching(None)
    with made(task, reward=reward, jitter=0.0) as env:
        seen, info = env.reset(seed=3)
        np.testing.assert_allclose(seen["desired_goal"], task.goal(3).position)
        terminated, rewards, infos = False, [], [info]
        while not terminated:
            way = (seen["desired_goal"] - seen["achieved_goal"]) / 0.05
            seen, got, terminated, truncated, info = env.step([*way, 0.0, 1.0])
            rewards.append(got)
            infos.append(info)
            assert not truncated
            again = env.compute_reward(seen["achieved_goal"], seen["desired_goal"], info)
            assert got == again
        assert info["is_success"]
        assert info["time"] - infos[0]["time"] < 3.0
        assert [one["is_success"] for one in infos[-6:]] == [True] * 6  # 0.5 s
        assert -0.02 <= rewards[-1] <= 0.0
        assert rewards[0] == (-1.0 if reward == "sparse" else -infos[1]["distance"])
        with pytest.raises(ResetNeeded):
            env.step(np.zeros(5))


@pytest.mark.engine
def test_an_episode_ends_with_its_time_and_joints_move_as_told() -> None:
    with made(actions="joints", **SHORT) as env:
        with pytest.raises(ResetNeeded):
            env.step(np.zeros(8))
        first, _ = env.reset(seed=1)
        at, told = first["observation"][:7], first["observation"][18:25]
        np.testing.assert_allclose(told, at, atol=0.01)
        for wrong in (np.zeros(7), np.full(8, np.nan)):
            with pytest.raises(InvalidAction):
                env.step(wrong)
        with pytest.raises(UnsupportedMode):
            env.render()
        ends = [env.step([5.0, *np.zeros(7)]) for _ in range(4)]  # 1 is the most
        assert [end[3] for end in ends] == [False, False, False, True]
        assert not any(end[2] for end in ends)
        moved = ends[-1][0]["observation"][:9] - first["observation"][:9]
        assert moved[0] == pytest.approx(0.4, abs=0.05)
        assert ends[-1][4]["time"] == pytest.approx(0.6)


@pytest.mark.engine
@pytest.mark.parametrize(("how", "told"), [(signal.SIGKILL, "SIGKILL"), (signal.SIGSTOP, "2 s")])
def test_a_worker_that_dies_or_hangs_ends_the_episode_and_the_next_one_has_a_new_one(
    how: signal.Signals, told: str
) -> None:
    with made(**SHORT) as env:
        env._handle.case = replace(env._handle.case, stall_timeout=2.0)
        before, _ = env.reset(seed=1)
        os.kill(env._handle._process.pid, how)
        seen, _, terminated, truncated, info = env.step(np.zeros(5))
        assert (terminated, truncated) == (False, True)
        assert told in info["crashed"]
        np.testing.assert_array_equal(seen["observation"], before["observation"])
        again, _ = env.reset(seed=1)
        np.testing.assert_array_equal(again["observation"], before["observation"])
        env.step(np.zeros(5))
        os.kill(env._handle._process.pid, how)
        env.reset()  # also one that died in between


class Sloping(PushingToGoal):
    def scene(self, seed: int, jitter: Jitter) -> Scene:
        return replace(super().scene(seed, jitter), gravity=(40.0, 0.0, -9.81))


@pytest.mark.engine
def test_what_cannot_be_ends_the_episode() -> None:
    with made(Sloping(None)) as env:
        env.reset(seed=1)
        truncated = False
        while not truncated:
            *_, terminated, truncated, info = env.step(np.zeros(5))
        assert not terminated
        assert "'block' left the room" in info["crashed"]


@pytest.mark.engine
@pytest.mark.filterwarnings("error")
def test_nothing_is_left_of_an_environment_that_nobody_closed() -> None:
    before = workers()
    env = make("reaching", "mujoco")
    env.reset()
    assert workers() - before
    del env
    gc.collect()
    assert not workers() - before
    program = (
        "from pytest_simbench import make\n"
        "env = make('reaching', 'mujoco', num_envs=2)\n"
        "env.reset()\n"
        "print(*[one.env._handle._process.pid for one in env.envs])\n"
    )
    ended = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=120, check=True
    )
    assert ended.stderr == ""
    assert len(ended.stdout.split()) == 2
    assert not any(psutil.pid_exists(int(pid)) for pid in ended.stdout.split())


@pytest.mark.engine
def test_several_at_once_are_as_one_after_the_other() -> None:
    actions = np.random.default_rng(2).uniform(-1, 1, (7, 2, 5))
    with made("pushing", num_envs=2, **SHORT) as envs:
        assert envs.metadata["autoreset_mode"] is gymnasium.vector.AutoresetMode.NEXT_STEP
        steps = played(envs, 5, actions)
        assert steps[0][0] in envs.observation_space
        assert steps[4][3].all()
        assert not steps[5][3].any()
        assert (steps[5][1] == 0).all()
        os.kill(envs.envs[1].env._handle._process.pid, signal.SIGKILL)
        *_, truncated, infos = envs.step(actions[0])
        assert truncated.tolist() == [False, True]
        assert "SIGKILL" in infos["crashed"][1]
        with pytest.raises(InvalidAction):
            envs.step(actions[0, 0])
    with made("pushing", **SHORT) as env:
        for k in range(2):
            single = played(env, 5 + k, actions[:4, k])
            seen, info = env.reset()
            single += [(seen, 0.0, False, False, info), *(env.step(row) for row in actions[5:, k])]
            for one, many in zip(single, steps, strict=True):
                for name, row in one[0].items():
                    np.testing.assert_array_equal(many[0][name][k], row)
                if many is not steps[0]:
                    assert [told[k] for told in many[1:4]] == list(one[1:4])


def test_what_an_action_commands_and_a_place_is_worth() -> None:
    """In a tenth of a second, and in a twentieth; none of it needs a worker."""
    places, goal = [[0.02, 0.0, 0.0], [0.0, 0.021, 0.0]], np.zeros(3)
    env = make("pushing", "mujoco", jitter=0.5, reward="sparse", robot=panda(), python="p")
    assert [box.shape for _, box in sorted(env.observation_space.items())] == [(3,), (3,), (51,)]
    assert {box.dtype for box in (env.action_space, *env.observation_space.values())} == {REAL}
    assert env._jitter == Jitter(0.0005, np.radians(0.5))
    found = env._command(checked([2.0, 0.0, -2.0, 0.5, 0.5], env.action_space))
    assert found.tool_change == pytest.approx((0.05, 0.0, -0.05, 0.0, 0.0, 0.075))
    assert (found.gripper, found.position) == (pytest.approx(0.75 * 0.07), None)
    assert env.compute_reward(places, goal, {}).tolist() == [0.0, -1.0]
    case = env._handle.case
    assert (case.mode, case.profile, case.python, case.test) == HOW
    assert env.metadata == {"render_modes": ["rgb_array"], "render_fps": 10.0}
    assert (env.render_mode, env._looking) == (None, Looking())
    env.task = SimpleNamespace(tolerance=0.026, scale=0.8)  # of a smaller arm, 0.0208 m
    assert env.compute_reward(places, goal, {}).tolist() == [0.0, -1.0]
    env = make("pushing", "mujoco", render_mode="rgb_array")
    assert (env.render_mode, env._looking) == ("rgb_array", Looking(picture=(480, 480)))
    assert make_vec("pushing", "mujoco", 2).num_envs == 2
    delays = {"command_latency": 0.05, "observation_delay": 0.1}
    env = make("reaching", "mujoco", actions="joints", seconds=1.0, rate=20.0, **delays)
    assert (env._jitter, env.rhythm) == (Jitter(), Rhythm(20.0, 0.05, 0.1))
    assert env.compute_reward(places, goal, {}).tolist() == [-0.02, -0.021]
    env._position = np.array([0.0, 1.75, *panda().column("initial_position")[2:]])
    env._position[3] = -3.06
    found = env._command(checked([-1, 1, 0, -1, 0, 0, 0, -1], env.action_space))
    wanted = [-0.05, 1.7628, 0.0, -3.0718]  # the ends of two ranges
    assert found.position[:4] == pytest.approx(wanted)
    assert (found.gripper, found.tool_change) == (0.0, None)


def test_what_is_asked_too_early_is_refused() -> None:
    env = make("pushing", "mujoco", python="p")
    with pytest.raises(ResetNeeded, match=r"^no episode is under way: call reset\(\)$"):
        env.step(np.zeros(5))
    told = "^make the environment with render_mode='rgb_array' for pictures$"
    with pytest.raises(UnsupportedMode, match=told):
        env.render()
    with pytest.raises(ResetNeeded, match=r"^no picture was taken yet: call reset\(\)$"):
        make("pushing", "mujoco", python="p", render_mode="rgb_array").render()
    for wrong in ("up", [[1.0], [1.0, 2.0]], np.zeros(4)):
        with pytest.raises(InvalidAction, match=r"^an action is finite numbers of shape \(5,\)"):
            checked(wrong, env.action_space)
    env.close()  # nothing to close


def test_side_by_side_nothing_begins_with_too_few_seeds_or_once_closed() -> None:
    envs = make_vec("pushing", "mujoco", 2, python="p")
    for seeds in ([1], [1, 2, 3]):
        with pytest.raises(ValueError, match="^seed=.*: give one number, or one for each of 2 env"):
            envs.reset(seed=seeds)
    assert not any(hasattr(env, "coming") for env in envs.envs)
    envs.close()
    for ask in (envs.reset, lambda: envs.step(np.zeros((2, 5)))):
        with pytest.raises(ClosedEnvironmentError, match="^these environments are closed: make"):
            ask()


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"task": "juggling"}, "task='juggling': choose from pick_and_place, pushing, reaching"),
        ({"task": 3}, "task=3: choose from"),
        ({"simulator": "none"}, "unknown simulator 'none'; choose from"),
        ({"rate": 30.1}, "asked every 33.22 ms, which is no multiple of the time step"),
        ({"rate": 0}, "the rate"),
        ({"seconds": 0}, "the seconds of an episode"),
        ({"tolerance": float("nan")}, "the tolerance"),
        ({"reward": "much"}, "reward='much': choose from dense, sparse"),
        ({"actions": None}, "actions=None: choose from joints, tool"),
        ({"render_mode": "human"}, "render_mode='human': choose from None, rgb_array"),
        ({"profile": "best"}, "best"),
        ({"robot": "nobody"}, "unknown robot 'nobody'"),
        ({"colour": 1}, "parameter='colour': choose from command_latency, observation_delay"),
        ({"settle": 1.0}, "parameter='settle': choose from"),  # an episode has no such end
        ({"num_envs": 0}, "num_envs=0: give a whole number from 1 on"),
    ],
    ids=str,
)
def test_bad_input_is_one_sentence(options: dict[str, Any], told: str) -> None:
    with pytest.raises(BadInput) as caught:
        make(**{"task": "pushing", "simulator": "mujoco", **options})
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


def test_without_gymnasium_a_sentence_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(making, "find_spec", lambda name: None)
    with pytest.raises(BadInput, match=r"pip install 'pytest-simbench\[gym\]'"):
        pytest_simbench.make("pushing", "mujoco")
    with pytest.raises(BadInput, match=r"pip install 'pytest-simbench\[gym\]'"):
        make_vec("pushing", "mujoco")


@pytest.mark.parametrize("name", sorted(set(ADAPTERS) - set(able_to(Capability.OFFSCREEN))))
def test_what_draws_nothing_says_so(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(making, "missing", lambda info: None)
    with pytest.raises(BadInput, match="draws no pictures"):
        make(PushingToGoal(None), name, render_mode="rgb_array")
    assert make("pushing", name).metadata["render_modes"] == []


def test_the_default_rate_is_whole_steps_of_every_engine() -> None:
    for name in ADAPTERS:
        Rhythm(RATE).steps(adapter(name).profiles["tuned"].timestep)


def test_gymnasium_knows_the_ids() -> None:
    for name, task in IDS.items():
        spec = gymnasium.spec(f"simbench/{name}")
        assert spec.kwargs == {"task": task}
        assert task in making.TASKS
