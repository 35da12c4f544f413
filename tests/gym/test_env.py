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
from gymnasium.error import InvalidAction, ResetNeeded, UnsupportedMode
from gymnasium.utils.env_checker import check_env

from pytest_simbench.client.closed_loop import Looking
from pytest_simbench.client.environments import missing
from pytest_simbench.client.errors import Unavailable, WorkerExited
from pytest_simbench.gym.env import checked
from pytest_simbench.gym.making import make
from pytest_simbench.motion.panda import panda
from pytest_simbench.scene import Scene
from pytest_simbench.scene.policy import Rhythm
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.tasks.base import Jitter
from pytest_simbench.tasks.goals import PushingToGoal, Reaching
from tests.conftest import ADAPTERS, workers
from tests.gym.scripted import AWAY, GONE, NEAR, OUT, TASK, plain, scripted, told_of

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
    for wrong in ("up", ["up"] * 5, [[1.0], [1.0, 2.0]], np.zeros(4)):
        with pytest.raises(InvalidAction, match=r"^an action is finite numbers of shape \(5,\)"):
            checked(wrong, env.action_space)
    env.close()  # nothing to close


def test_an_episode_from_its_first_look_to_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is terminated once the block was at its goal for half a second, as it is now; what is
    seen and rewarded may be older."""
    env, world = scripted(monkeypatch, AWAY, *[NEAR] * 6, seconds=2.0, render_mode="rgb_array")
    seen, info = env.reset(seed=3)
    scene = TASK.scene(3, Jitter())
    assert world.done == [scene, "settle start", 0.2]
    assert (world.process.deadline, world.process.where.seed) == (None, 3)
    assert world.process.where.phase == "act"
    assert world.given == {
        "process": world.process, "scene": scene, "rhythm": Rhythm(10.0), "timestep": 0.001,
        "seconds": pytest.approx(2.1), "kinematics": env._servo, "looking": env._looking,
        "goal": TASK.goal(3),
    }  # fmt: skip
    assert (plain(seen), info) == told_of(world, 3, 0, 0.0)[::2]
    assert env.render()[0, 0, 0] == 0
    for k in range(1, 7):
        seen, reward, terminated, truncated, info = env.step([0.0, 0.1 * k, 0.0, 0.0, 1.0])
        assert (plain(seen), reward, info) == told_of(world, 3, k, -0.05 if k == 1 else -0.01)
        assert (terminated, truncated) == (k == 6, False)
        assert world.done[2 + k].tool_change == pytest.approx((0, 0.005 * k, 0, 0, 0, 0))
        assert env.render()[0, 0, 0] == k
    assert world.done[9:] == ["left"]


def test_joints_go_on_from_the_set_points(monkeypatch: pytest.MonkeyPatch) -> None:
    env, world = scripted(monkeypatch, *[AWAY] * 3, seconds=0.2, actions="joints")
    env.reset(seed=1)
    ends = [env.step([1.0, *np.zeros(7)])[2:4] for _ in range(2)]
    assert ends == [(False, False), (False, True)]  # its time is over
    first = world.seen[0].told[0][:7]
    for command, way in zip(world.done[3:], (0.1, 0.2), strict=False):
        wanted = np.clip(first + way * np.eye(7)[0], env._servo.model.lower, env._servo.model.upper)
        assert command.position == pytest.approx(wanted)
    assert world.done[5:] == ["left"]
    short, _ = scripted(monkeypatch, AWAY, AWAY, seconds=0.01)
    short.reset(seed=1)
    assert short.step(np.zeros(5))[2:4] == (False, True)


@pytest.mark.parametrize(("end", "why"), [(GONE, "it is gone"), (OUT, "'block' left the room")])
def test_a_crash_ends_the_episode_and_its_worker(
    monkeypatch: pytest.MonkeyPatch, end: Any, why: str
) -> None:
    """Its time is over with the same step: it has crashed all the same."""
    env, world = scripted(monkeypatch, AWAY, end, NEAR, seconds=0.1)
    before, was = env.reset(seed=2)
    seen, reward, terminated, truncated, info = env.step(np.zeros(5))
    assert (plain(seen), info["crashed"][: len(why)]) == (plain(before), why)
    assert {**info, "crashed": 0} == {**was, "crashed": 0}
    assert all(seen[name] is not before[name] for name in seen)
    assert (reward, terminated, truncated) == (pytest.approx(-0.05), False, True)
    assert world.done[-2:] == ["left", "closed"]


def test_an_interrupt_leaves_no_answer_under_way(monkeypatch: pytest.MonkeyPatch) -> None:
    env, world = scripted(monkeypatch, AWAY, KeyboardInterrupt())
    env.reset(seed=2)
    with pytest.raises(KeyboardInterrupt):
        env.step(np.zeros(5))
    assert world.done[-2:] == ["left", "closed"]


def test_a_reset_is_tried_twice_and_draws_a_seed_of_its_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    env, world = scripted(monkeypatch, GONE, AWAY, AWAY, AWAY, AWAY, GONE, GONE)
    env.reset(seed=4)
    scene = TASK.scene(4, Jitter())
    assert world.done == [scene, "closed", scene, "settle start", 0.2]
    seeds = [env.reset()[1]["seed"] for _ in range(2)]
    again = [env.reset(seed=4)[1]["seed"], int(np.random.default_rng(4).integers(2**31))]
    assert again == [4, seeds[0]]
    assert seeds[0] != seeds[1]
    assert world.done.count("left") == 3
    with pytest.raises(WorkerExited, match="it is gone"):
        env.reset()
