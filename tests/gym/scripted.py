"""Environments whose worlds are written down: no engine runs."""

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
from pytest_simbench.gym.making import make
from pytest_simbench.scene import Pose, Scene
from pytest_simbench.scene.policy import Observation, Rhythm
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
