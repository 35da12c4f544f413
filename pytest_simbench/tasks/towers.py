"""Leaning towers: cubes stacked with overhang, a known distance from toppling. No robot.

A task to perturb: its episodes are short, and statics says how much it takes. Each cube of a
tower stands `overhang` beyond the one below. The centre of mass of all cubes above the lowest of n
lies n/2 overhangs beyond that cube's, and the tower stands while this is less than half an edge
(higher interfaces have more to spare). What is left of the half edge is the tower's margin: drawing
the lowest cube back by more than the margin topples it, and nothing smaller should.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from pytest_simbench.client.world import World
from pytest_simbench.records.metrics import Metric
from pytest_simbench.scene import Box, Pose, Scene
from pytest_simbench.tasks.base import CUBE_SIZE, Count, Jitter, Outcome, Task, cube, distance

STANDING_DISTANCE = 0.01
"""A cube farther than this from its place when the scene was built has fallen [m]."""

SPACING = 0.3
"""Between two towers [m]: more than a tower of four is high, so none falls on another."""

WHITE, ORANGE = (0.9, 0.9, 0.9, 1.0), (0.9, 0.55, 0.15, 1.0)


@dataclass(frozen=True)
class LeaningTowers(Task):
    """Towers that lean towards +x and should stand; the start jitter does not apply to them.

    Attributes:
        margins: of each tower: how far its lowest cube can be drawn back before it topples [m].
        levels: cubes in each.
        settle: how long they must stand [s].
    """

    name: ClassVar[str] = "leaning towers"
    study_timeout: ClassVar[float] = 60.0
    counted: ClassVar[str] = "cubes standing"

    margins: tuple[float, ...] = (0.008, 0.010, 0.012)
    levels: int = 4
    settle: float = 3.0

    @property
    def metrics(self) -> tuple[Metric, ...]:
        towers = len(self.margins)
        return (
            Metric("standing", "standing", kind="share", of=towers * self.levels,
                   doc=f"cubes within 1 cm of their start {self.settle:g} s later"),
            Metric("towers", "towers", kind="share", of=towers,
                   doc="towers all of whose cubes stand"),
        )  # fmt: skip

    def smoke(self) -> LeaningTowers:
        return replace(self, margins=self.margins[:1], settle=min(self.settle, 1.5))

    def change(self, before: Outcome, after: Outcome) -> str:
        """Which towers: "topples tower 2"."""
        old, new = before.details["toppled"], after.details["toppled"]
        fallen = [name for name in new if name not in old]
        if fallen:
            return f"topples {' and '.join(fallen)}"
        saved = [name for name in old if name not in new]
        return f"saves {' and '.join(saved)} from toppling" if saved else ""

    def tower_of(self, number: int) -> int:
        """The tower, from 1, of a cube's number in scene order, from 0."""
        return number // self.levels + 1

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        cubes: list[Box] = []
        for tower, margin in enumerate(self.margins):
            overhang = (CUBE_SIZE - 2 * margin) / self.levels
            for level in range(self.levels):
                x, z = overhang * level, CUBE_SIZE * (level + 0.5)
                pose = Pose.at(0.4 + x, SPACING * tower, z)
                colour = ORANGE if level % 2 else WHITE
                cubes.append(cube(f"cube_{len(cubes) + 1:02d}", pose, colour))
        return Scene("leaning towers", tuple(cubes))

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        world.mark("start")
        with world.phase("settle"):
            world.wait(self.settle)
        world.mark("end")
        fallen, toppled = [], set()
        for number, body in enumerate(world.scene.free_bodies):
            if distance(world.pose(body.name), body.pose) > STANDING_DISTANCE:
                fallen.append(body.name)
                toppled.add(self.tower_of(number))
        total = len(self.margins) * self.levels
        count(total - len(fallen), total)
        return Outcome(
            {
                "standing": 1 - len(fallen) / total,
                "towers": 1 - len(toppled) / len(self.margins),
            },
            {"fallen": fallen, "toppled": [f"tower {tower}" for tower in sorted(toppled)]},
        )
