"""Episodes in worlds that are written down: what is asked of them, and what environments tell."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pytest_simbench.client.errors import Where, WorkerError, WorkerExited
from pytest_simbench.gym.env import told
from pytest_simbench.gym.making import make, make_vec
from pytest_simbench.scene import Pose, Scene
from pytest_simbench.scene.policy import Observation, Rhythm
from pytest_simbench.tasks.base import Jitter
from pytest_simbench.tasks.goals import PushingToGoal

TASK, WHERE = PushingToGoal(None), Where("sim", "headless")
GONE = WorkerExited("it is gone", WHERE)
NEAR, AWAY, OUT = (0.01, 0.0, 0.0), (0.03, 0.04, 0.0), (0.0, 0.0, 99.0)


class Written:
    """In the place of a handle and its loop: where the block is from its goal each time that it is
    seen, or an error; and all that is asked."""

    constructed = SimpleNamespace(settings={"timestep": 0.001})

    def __init__(self, *script: Any) -> None:
        self.script, self.done, self.process = list(script), list[Any](), SimpleNamespace()

    def world(self, scene: Scene) -> Any:
        self.done.append(scene)
        if isinstance(self.script[0], WorkerError):
            raise self.script.pop(0)
        self.process = SimpleNamespace(deadline=1.0, where=Where("sim", "headless"))
        waits = {"phase": self.phase, "wait": self.done.append}
        return SimpleNamespace(scene=scene, process=self.process, **waits)

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        yield self.done.append(name)

    def begin(self, process: Any, scene: Scene, rhythm: Rhythm, **given: Any) -> None:
        self.given = {"process": process, "scene": scene, "rhythm": rhythm, **given}
        self.seen: list[Observation] = []
        self.look()

    def look(self) -> None:
        away, k = self.script.pop(0), len(self.seen)
        if isinstance(away, BaseException):
            raise away
        goal, arm = self.given["goal"], self.given["scene"].arm
        block = Pose.at(*np.add(goal.position, away), yaw=0.1 * k).as_array()
        joints = arm.column("initial_position") + 0.01 * k
        self.seen.append(
            Observation(
                0.2 + 0.1 * k, joints, joints - 1, np.stack([joints + 0.5, 0 * joints, joints]),
                np.array([[*block, *np.arange(6.0) + k]]), ("block",), goal,
                picture=np.full((1, 1, 3), k), kinematics=self.given["kinematics"],
            )
        )  # fmt: skip

    def close(self) -> None:
        self.done.append("closed")


class Loop:
    """What may be seen of it is one earlier than what is."""

    def __init__(self, world: Written, *where: Any, **given: Any) -> None:
        self.world = world
        world.begin(*where, **given)

    def reply(self, command: Any) -> None:
        self.world.done.append(command)
        self.world.look()

    now = property(lambda self: self.world.seen[-1])
    observation = property(lambda self: self.world.seen[-2:][0])

    def close(self) -> None:
        self.world.done.append("left")


def scripted(monkeypatch: pytest.MonkeyPatch, *script: Any, **options: Any) -> tuple[Any, Written]:
    """An environment, and its world."""
    env, world = make("pushing", "mujoco", python="p", **options), Written(*script)
    monkeypatch.setattr("pytest_simbench.gym.env.ClosedLoop", partial(Loop, world))
    env._handle = world
    return env, world


def told_of(world: Written, seed: int, k: int, reward: float) -> tuple[Any, float, Any]:
    """What an environment shall say of the k-th that is seen."""
    now, seen, task = world.seen[k], world.seen[max(0, k - 1)], TASK
    block = Pose.from_array(seen.bodies[0])
    parts = [seen.position, seen.velocity, seen.told[0], told(seen.tool), told(block)]
    distance = task.distance(now, seed)
    return (
        {
            "observation": np.concatenate([*parts, seen.bodies[0, 7:]]).tolist(),
            "achieved_goal": [*block.position],
            "desired_goal": [*task.goal(seed).position],
        },
        pytest.approx(reward),
        {"is_success": distance <= 0.02, "distance": distance, "time": now.time, "seed": seed},
    )


def plain(seen: Any) -> dict[str, list[float]]:
    return {name: row.tolist() for name, row in seen.items()}


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


def test_several_begin_together_and_each_anew_once_it_is_over(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Seeds count from a number on, or are given; one that is masked out is left as it is."""
    envs = make_vec("pushing", "mujoco", 2, python="p", seconds=0.2)
    worlds = [Written(*[(0.1 * n + 0.1, 0.0, 0.0)] * 20) for n in range(2)]

    def loop(process: Any, *more: Any, **given: Any) -> Loop:
        (world,) = (one for one in worlds if one.process is process)
        return Loop(world, process, *more, **given)

    monkeypatch.setattr("pytest_simbench.gym.env.ClosedLoop", loop)
    for env, world in zip(envs.envs, worlds, strict=True):
        env.env._handle = world
    actions = np.array([[0.5, 0, 0, 0, 1], [-0.5, 0, 0, 0, 1]])
    _, info = envs.reset(seed=np.int64(5))
    assert info["seed"].tolist() == [5, 6]
    seen, reward, *_ = envs.step(actions)
    assert reward == pytest.approx([-0.1, -0.2])
    assert seen["achieved_goal"].shape == (2, 3)
    assert [w.done[-1].tool_change[0] for w in worlds] == pytest.approx([0.025, -0.025])
    mask = np.array([False, True])
    assert envs.reset(seed=[1, 9], options={"reset_mask": mask})[1]["seed"].tolist()[1] == 9
    assert [len(w.seen) for w in worlds] == [2, 1]
    assert envs.step(actions)[3].tolist() == [True, False]
    assert envs.step(actions)[3].tolist() == [False, True]  # the first one has begun anew
    assert [len(w.seen) for w in worlds] == [1, 3]
    assert envs.step(actions)[3].tolist() == [False, False]
    assert [len(w.seen) for w in worlds] == [2, 1]
    envs.reset()
    assert [len(w.seen) for w in worlds] == [1, 1]
    envs.close()
    assert [w.done[-1] for w in worlds] == ["closed"] * 2
