"""A keyframe of a user's scene is held by its drives: how far do its joints go, how calmly?"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from pytest_simbench.client.world import World
from pytest_simbench.records.metrics import Metric
from pytest_simbench.scene import FloatArray, Start, Trajectory
from pytest_simbench.scene.checks import check_number
from pytest_simbench.tasks.base import Count, Outcome
from pytest_simbench.tasks.on_scene import FARTHEST, OnJoints, places, started, ways
from pytest_simbench.tasks.resting import LOG_PERIOD, RESTLESS, SHORTEST, rates, rest


@dataclass(frozen=True)
class Holding(OnJoints):
    """Start a scene at a keyframe and tell its drives what that tells them.

    Attributes:
        world: the scene. Repetitions go through its `starts` (keyframes); without any, each joint
            is held where it is written.
        seconds: simulated time, 1 at least [s].

    Raises:
        SceneError: the scene has no joints, or the time is too short.
    """

    name: ClassVar[str] = "holding"
    draws: ClassVar[bool] = False

    seconds: float = 2.5

    def __post_init__(self) -> None:
        super().__post_init__()
        check_number(self.seconds, f"the time [s] of {self.name}", SHORTEST)

    @property
    def metrics(self) -> tuple[Metric, ...]:
        speeds = f"root mean square speed in the last {RESTLESS:g} s, of the joint with the largest"
        return (
            *self.metric_by_kind("gone", "farthest joint", "from its start, at the end"),
            *self.metric_by_kind("restless", "restless", speeds, per="/s"),
            *(FARTHEST for _ in self.world.free_bodies[:1]),
        )

    def smoke(self) -> Holding:
        return replace(self, seconds=SHORTEST)

    def parameters(self) -> dict[str, Any]:
        return super().parameters() | {"task.seconds": self.seconds}

    def commands(self, seed: int) -> FloatArray:
        """What the drives are told: positions, velocities and efforts, (3, n_joints)."""
        start = self.start(seed) or Start((), ())
        targets = start.targets or start.positions or self.world.arm.column("initial_position")
        none = (0.0,) * len(targets)
        return np.array([targets, start.speeds or none, start.efforts or none])

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        before, told = world.joints[0], self.commands(seed)
        world.follow(Trajectory(LOG_PERIOD, *np.stack([told, told], axis=1)))
        seen = rest(world, self.seconds, "hold")
        gone = world.joints[0] - before
        metrics = self.by_kind("gone", np.abs(gone))
        metrics |= self.by_kind("restless", rates(seen.time, seen.joints[:, 0]))
        bodies = places(world)
        moved = ways(started(world.scene), bodies)
        if moved:
            metrics["farthest"] = max(moved.values())
        details = {
            "gone": dict(zip(self.joints, gone.tolist(), strict=True)),
            "targets": dict(zip(self.joints, told[0].tolist(), strict=True)),
            "places": {name: pose.as_array().tolist() for name, pose in bodies.items()},
        }
        return Outcome(metrics, details)
