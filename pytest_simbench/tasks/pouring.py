"""A contact task: balls are poured out of a cup into a tray. Their number is conserved.

No arm takes part: the cup turns as prescribed. Nothing bounces, so no ball may leave the tray, and
none may be outside the cup before it is tilted so far that one can roll over its rim. What it costs
as the number of balls grows tells how an engine's contact solver scales.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.client.world import World
from pytest_simbench.records.metrics import Metric
from pytest_simbench.scene import Box, Compound, FloatArray, Pose, Scene, Sphere
from pytest_simbench.scene.checks import check_count
from pytest_simbench.tasks.base import Count, Jitter, Moment, Outcome, Randomness, Task

RADIUS, MASS = 0.008, 0.005
"""Of a ball [m], [kg]: a glass marble of 16 mm."""

FRICTION = 0.5

SPACING = 0.0165
"""Between the centres of balls at the start [m]."""

WALL = 0.004
"""Thickness of the cup and of the tray's walls [m]."""

RIM = 0.03
"""Of the cup above the balls [m]."""

HEIGHT = 0.30
"""Of the cup's middle above the ground [m]."""

TRAY, EDGE = 0.6, 0.1
"""Inner side of the tray, and height of its walls [m]."""

SPIN = 0.8
"""Of the cup [rad/s]."""

UPRIGHT = math.radians(20.0)
"""Tilt up to which no ball can get over the rim [rad]: heaps of balls are flatter than the rim is
above them there."""

STEEL, GLASS = (0.7, 0.72, 0.75, 1.0), (0.35, 0.65, 0.55, 1.0)


@dataclass(frozen=True)
class Pouring(Task):
    """Pour balls into a tray.

    Attributes:
        balls: how many.
        tilt: of the cup at the end [rad].
        settle: from then to the count [s].
    """

    name: ClassVar[str] = "pouring"
    counted: ClassVar[str] = "balls in the tray"
    moments: ClassVar[tuple[Moment, ...]] = (Moment("before the pouring", "pour"),)
    references: ClassVar[Mapping[str, float]] = {"in_tray": 1.0, "leaked": 0.0}

    balls: int = 30
    tilt: float = math.radians(150.0)
    settle: float = 2.0

    def __post_init__(self) -> None:
        check_count(self.balls, f"the number of balls of {self.name}")

    @property
    def metrics(self) -> tuple[Metric, ...]:
        return (
            Metric("in_tray", "in the tray", kind="share", of=self.balls,
                   doc=f"balls that lie in the tray {self.settle:g} s after the pouring"),
            Metric("leaked", "leaked", kind="share", of=self.balls, better="lower",
                   doc="balls outside the cup while it is still nearly upright"),
        )  # fmt: skip

    def smoke(self) -> Pouring:
        return replace(self, balls=min(self.balls, 6), settle=0.5)

    @property
    def side(self) -> int:
        """Balls along an edge of the cup's floor."""
        return max(2, round(math.cbrt(self.balls / 3)) + 1)

    def cup(self) -> Compound:
        """Five plates, open above."""
        layers = math.ceil(self.balls / self.side**2)
        inner, high = self.side * SPACING + 0.002, layers * SPACING + RIM
        wide, half = inner + 2 * WALL, (inner + WALL) / 2
        plates = {
            "floor": ((wide, wide, WALL), (0.0, 0.0, -(high + WALL) / 2)),
            "left": ((WALL, wide, high), (-half, 0.0, 0.0)),
            "right": ((WALL, wide, high), (half, 0.0, 0.0)),
            "front": ((inner, WALL, high), (0.0, -half, 0.0)),
            "back": ((inner, WALL, high), (0.0, half, 0.0)),
        }
        return Compound(
            "cup",
            tuple(
                Box(name, size, Pose.at(*at), 0.0, FRICTION) for name, (size, at) in plates.items()
            ),
            Pose.at(0.0, 0.0, HEIGHT + high / 2),
            friction=FRICTION,
            colour=STEEL,
            prescribed=True,
            angular_velocity=(0.0, SPIN, 0.0),
        )

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        rng, cup = Randomness.of(seed).start, self.cup()
        floor = cup.pose.position[2] - cup.extents[2] / 2 + WALL
        balls = []
        for k in range(self.balls):
            layer, place = divmod(k, self.side**2)
            x, y = (SPACING * (i - (self.side - 1) / 2) for i in divmod(place, self.side))
            aside = rng.uniform(-2e-4, 2e-4, 2)  # else they stand in columns
            at = Pose.at(
                x + float(aside[0]), y + float(aside[1]), floor + SPACING * layer + SPACING / 2
            )
            balls.append(Sphere(f"ball_{k + 1:02}", RADIUS, at, MASS, FRICTION, GLASS))
        out = (TRAY + WALL) / 2
        walls = [
            Box(name, (abs(y) * TRAY + WALL, abs(x) * TRAY + WALL, EDGE),
                Pose.at(x * out, y * out, EDGE / 2), 0.0, FRICTION, STEEL)
            for name, x, y in (("east", 1, 0), ("west", -1, 0), ("north", 0, 1), ("south", 0, -1))
        ]  # fmt: skip
        return Scene("pouring", (*balls, cup, *walls), ground_friction=FRICTION)

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        names = [f"ball_{k + 1:02}" for k in range(self.balls)]
        world.mark("start")
        with world.phase("lean"):
            world.wait(UPRIGHT / SPIN)
        inside = self.within(world.pose("cup"), _centres(world, names))
        with world.phase("pour"):
            world.wait((self.tilt - UPRIGHT) / SPIN, striking=True)
        world.mark("end")
        with world.phase("settle"):
            world.wait(self.settle)
        ends = _centres(world, names)
        lying = (np.abs(ends[:, :2]) < TRAY / 2).all(axis=1) & (np.abs(ends[:, 2]) < EDGE)
        count(int(lying.sum()), self.balls)
        return Outcome(
            {"in_tray": float(lying.mean()), "leaked": 1.0 - float(inside.mean())},
            {"ends": ends.tolist()},
        )

    def within(self, cup: Pose, centres: FloatArray) -> NDArray[np.bool_]:
        """Which balls are inside a cup, (n,)."""
        local = (centres - cup.position) @ cup.rotation()
        return np.asarray((np.abs(local) < np.array(self.cup().extents) / 2).all(axis=1))


def _centres(world: World, names: list[str]) -> FloatArray:
    return np.array([world.pose(name).position for name in names])
