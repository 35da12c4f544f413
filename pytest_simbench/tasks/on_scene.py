"""What tasks on a user's scene have in common: where it starts, and how far things went."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.client.world import World
from pytest_simbench.description.urdf import PreparedRobot
from pytest_simbench.ground.names import data_digest
from pytest_simbench.records.metrics import RESOLUTIONS, Metric
from pytest_simbench.scene import Body, Compound, FloatArray, Pose, Scene, SceneError, Start
from pytest_simbench.tasks.base import Jitter, Task, distance


@dataclass(frozen=True)
class OnScene(Task):
    """A task on a scene. Repetitions go through its `starts`, if it has some; `--jitter` does not
    count.

    Attributes:
        world: the scene, of a file (`scene_file`) or made by hand.
    """

    shares_worker: ClassVar[bool] = True

    world: Scene

    def parameters(self) -> dict[str, Any]:
        """The scene by its digest, in which it does not matter where its files are."""
        wire = {key: value for key, value in self.world.to_wire().items() if key != "file"}
        if robot := wire["robot"]:
            wire["robot"] = {**robot, "urdf": Path(robot["urdf"]).name, "srdf": "", "packages": {}}
        return {
            "task.scene": self.world.name,
            "task.scene_digest": data_digest(wire, 16),
            "task.starts": len(self.starts),
        }

    @property
    def starts(self) -> Sequence[Start]:
        """That repetitions go through."""
        return self.world.starts

    @property
    def different(self) -> int | None:
        """Each start once, of a task that draws nothing else."""
        return None if self.draws else max(1, len(self.starts))

    def start(self, seed: int) -> Start | None:
        """Where a repetition starts; None: as the scene is written."""
        return self.starts[seed % len(self.starts)] if self.starts else None

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        start, world = self.start(seed), self.world
        if len(world.frictions) > 1:
            world = replace(world, written=tuple(body.pose for body in world.bodies))
        return world if start is None else world.at_start(start)


@dataclass(frozen=True)
class OnJoints(OnScene):
    """A task on a scene that has joints.

    Raises:
        SceneError: it has none.
    """

    def __post_init__(self) -> None:
        if not self.joints:
            raise SceneError(
                f"scene {self.world.name!r} has no joints, so it has no drives to command; give "
                "one with joints, or leave it to itself (Settling)"
            )

    @property
    def joints(self) -> tuple[str, ...]:
        return () if self.world.robot is None else self.world.robot.joint_names

    @property
    def measured(self) -> Sequence[str]:
        """The joints of which something is measured."""
        return self.joints

    @cached_property
    def kinds(self) -> Mapping[str, tuple[NDArray[np.bool_], float, str]]:
        """Which of the measured joints are hinges and which are sliders, (n_joints,), where there
        are such, the factor from rad or m to the unit in which they are measured, and that unit."""
        kinds = {joint.name: joint.kind for joint in PreparedRobot(self.world.arm).joints}
        own = [kinds[name] if name in self.measured else "" for name in self.joints]
        found = {
            "hinges": (np.array([kind == "revolute" for kind in own]), 180 / np.pi, "deg"),
            "sliders": (np.array([kind == "prismatic" for kind in own]), 1000.0, "mm"),
        }
        return {kind: told for kind, told in found.items() if told[0].any()}

    def by_kind(self, name: str, values: FloatArray) -> dict[str, float | None]:
        """The largest of values, (n_joints,), for each kind of joint, in its unit."""
        return {
            f"{name}_{kind}": factor * float(values[own].max())
            for kind, (own, factor, _) in self.kinds.items()
        }

    def metric_by_kind(self, name: str, title: str, doc: str, per: str = "") -> list[Metric]:
        return [
            Metric(f"{name}_{kind}", f"{title}, {kind}", unit=unit + per, better="lower", least=0,
                   doc=doc, resolution=RESOLUTIONS[unit])
            for kind, (_, _, unit) in self.kinds.items()
        ]  # fmt: skip


FARTHEST = Metric(
    "farthest", "farthest from the start", unit="mm", better=None, least=0,
    doc="of the free body that is farthest from where it started, at the end",
)  # fmt: skip


def places(world: World) -> dict[str, Pose]:
    """Of the free bodies, as they are now."""
    return {b.name: place(b.moved_to(world.pose(b.name))) for b in world.scene.free_bodies}


def started(scene: Scene) -> dict[str, Pose]:
    """Of the free bodies, as a scene has them."""
    return {body.name: place(body) for body in scene.free_bodies}


def place(body: Body) -> Pose:
    """Of the frame that its file gives it, in the world."""
    return body.pose * body.file_frame if isinstance(body, Compound) else body.pose


def ways(before: Mapping[str, Pose], after: Mapping[str, Pose]) -> dict[str, float]:
    """How far each is from where it was [mm]."""
    return {name: 1000 * distance(before[name], pose) for name, pose in after.items()}
