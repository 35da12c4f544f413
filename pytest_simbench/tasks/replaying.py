"""The drives of a user's scene follow a log: how far are its joints from it, and where do its
bodies end?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from pytest_simbench.client.world import World
from pytest_simbench.records.metrics import Metric
from pytest_simbench.scene import FloatArray, Pose, SceneError, Start, Trajectory
from pytest_simbench.tasks.base import Count, Outcome
from pytest_simbench.tasks.on_scene import FARTHEST, OnJoints, places, started, ways
from pytest_simbench.tasks.resting import LOG_PERIOD


@dataclass(frozen=True, eq=False)
class Log:
    """Positions of joints along the time, and perhaps where free bodies were.

    Attributes:
        trajectory: that the drives follow, of all joints of the scene: what was told them, else
            where they were; those that are not in the log hold their start.
        joints: names of those that are in the log.
        start: of the scene, where the log begins.
        end: poses of the free bodies that are in the log where it ends, as in a `Start`.
        digest: of what was read.
        seen: as it was measured: `time` from 0 on [s], (n,), positions by joint, (n,), and
            `BODY/pose`, (n, 7).
        told: names of joints of which it holds what their drives were told.
    """

    trajectory: Trajectory
    joints: Sequence[str]
    start: Start
    end: Start
    digest: str
    seen: Mapping[str, FloatArray] = field(default_factory=dict)
    told: Sequence[str] = ()


@dataclass(frozen=True)
class Replaying(OnJoints):
    """Start a scene where a log begins, and have its drives follow it to its end.

    Attributes:
        world: the scene; its `starts` do not count.
        log: `scene_file.log(path, scene)`.

    Raises:
        SceneError: the scene has no joints, or the log is of other joints.
    """

    name: ClassVar[str] = "replaying"
    draws: ClassVar[bool] = False

    log: Log

    def __post_init__(self) -> None:
        super().__post_init__()
        columns = self.log.trajectory.position.shape[1]
        if columns != len(self.joints) or not set(self.log.joints) <= set(self.joints):
            raise SceneError(
                f"the log moves {', '.join(self.log.joints)} of {columns} joints, and scene "
                f"{self.world.name!r} has {', '.join(self.joints)}; read the log for this scene"
            )

    @property
    def measured(self) -> Sequence[str]:
        return self.log.joints

    @property
    def metrics(self) -> tuple[Metric, ...]:
        off = "of the free body that ends farthest from where the log has it"
        return (
            *self.metric_by_kind("error", "tracking error", "root mean square, of the worst joint"),
            *self.metric_by_kind("worst", "largest error", "of any joint at any time"),
            *(Metric("off", "off the log", unit="mm", better="lower", least=0, doc=off)
              for _ in self.log.end.bodies[:1]),
            *(Metric("turned", "turned off the log", unit="deg", better="lower", least=0,
                     doc="of the free body that is turned most from how the log ends")
              for _ in self.log.end.bodies[:1]),
            *(FARTHEST for _ in self.world.free_bodies[:1] if not self.log.end.bodies),
        )  # fmt: skip

    def parameters(self) -> dict[str, Any]:
        return super().parameters() | {
            "task.log": self.log.digest,
            "task.log_joints": list(self.log.joints),
            "task.seconds": self.log.trajectory.duration,
        }

    @property
    def starts(self) -> Sequence[Start]:
        return (self.log.start,)

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        told, began = self.log.trajectory, world.time
        with world.phase("follow"):
            motion = world.follow(told, log_period=LOG_PERIOD)
        grid = told.tick * np.arange(len(told.position))
        columns = dict(zip(self.joints, told.position.T, strict=True))
        wanted = [
            np.interp(motion.time - began, self.log.seen["time"], self.log.seen[name])
            if name in self.log.seen
            else np.interp(motion.time - began, grid, column)
            for name, column in columns.items()
        ]
        errors = motion.joints[:, 0] - np.transpose(wanted)
        metrics = self.by_kind("error", np.sqrt(np.mean(errors**2, axis=0)))
        metrics |= self.by_kind("worst", np.abs(errors).max(axis=0))
        bodies, end = places(world), self.log.end
        logged = dict(zip(end.bodies, end.poses, strict=True))
        if logged:
            own = {name: bodies[name] for name in logged}
            metrics["off"] = max(ways(logged, own).values())
            metrics["turned"] = max(turn(logged[name], pose) for name, pose in own.items())
        elif bodies:
            metrics["farthest"] = max(ways(started(world.scene), bodies).values())
        details = {
            "joints": dict(zip(self.joints, motion.joints[-1, 0].tolist(), strict=True)),
            "places": {name: pose.as_array().tolist() for name, pose in bodies.items()},
        }
        return Outcome(metrics, details)


def turn(a: Pose, b: Pose) -> float:
    """Angle between two orientations [deg]."""
    (w, x, y, z) = (a.inverse() * b).quaternion
    return float(np.degrees(2 * np.arctan2(np.linalg.norm([x, y, z]), abs(w))))
