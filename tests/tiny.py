"""A task that takes a moment: two cubes fall."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pytest_simbench.client.world import World
from pytest_simbench.records.metrics import Metric
from pytest_simbench.scene import Pose, Scene
from pytest_simbench.tasks.base import Count, Jitter, Outcome, Randomness, Task, cube

WHITE = (1.0, 1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Falling(Task):
    """Two cubes fall for `duration` [s] and are counted on the ground."""

    name: ClassVar[str] = "falling"
    study_timeout: ClassVar[float] = 60.0

    duration: float = 0.6

    @property
    def metrics(self) -> tuple[Metric, ...]:
        return (Metric("landed", "landed", kind="share", of=2, study=True),)

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        rng = Randomness.of(seed).start
        cubes = [
            cube(name, jitter.disturbed(Pose.at(x, 0.0, 0.1), rng), WHITE)
            for name, x in (("left", 0.0), ("right", 0.2))
        ]
        return Scene("falling", tuple(cubes))

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        world.mark("start")
        with world.phase("fall"):
            world.wait(self.duration)
        world.mark("end")
        landed = sum(pose.position[2] < 0.03 for pose in world.poses().values())
        count(landed, 2)
        return Outcome({"landed": landed / 2})
