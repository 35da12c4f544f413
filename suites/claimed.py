"""What the claims of `test_claims.py` measure beside laws and tasks: laws with starts that the seed
moves, and piles of cubes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pytest_simbench.client.world import World
from pytest_simbench.laws import LAWS
from pytest_simbench.laws.base import GRAVITY, Law, Reading, Watched, watch
from pytest_simbench.laws.contact import EDGE, HeavyOnTop, Tower
from pytest_simbench.laws.free import TumbleEnergy
from pytest_simbench.laws.impact import let_go
from pytest_simbench.laws.sliding import StoppingDistance
from pytest_simbench.records.metrics import Metric
from pytest_simbench.scene import Box, FloatArray, Pose, Scene, Vector3
from pytest_simbench.tasks.base import Count, Jitter, Outcome, Task

LAW = {law.name: law for law in LAWS}

STEPS = (1, 2)
"""By which our own time step is divided."""

DIFFERENCE = Metric("difference", "difference", better=None, least=0.0, resolution=0.0)

MOVED = 1e-3
"""By which cubes of a stack may be shifted on those below [m]."""


@dataclass(frozen=True)
class ShakenTower(Tower, name="shaken_tower"):
    """A tower whose cubes are not quite above each other."""

    overhangs: tuple[float, ...] = (-MOVED,) * 4


@dataclass(frozen=True)
class ShakenLoad(HeavyOnTop, name="shaken_load"):
    """Three such cubes of 1 kg that carry a heavier one."""

    top: float = 100.0
    overhangs: tuple[float, ...] = (-MOVED,) * 3

    @property
    def masses(self) -> tuple[float, ...]:
        return 1.0, 1.0, 1.0, self.top


TOWERS = ShakenTower(), ShakenTower(overhangs=(MOVED,) * 4)
ALIGNED = ShakenTower(overhangs=(-1e-12,) * 4), ShakenTower(overhangs=(1e-12,) * 4)
LOADS = ShakenLoad(), ShakenLoad(top=50.0, overhangs=(MOVED,) * 3)
"""Between which the seed draws."""


@dataclass(frozen=True)
class SpinGain(TumbleEnergy, name="spin_gain", quantity="gain of kinetic energy", unit="%"):
    """How far the energy of a body that tumbles rises above the least that it had."""

    omega: Vector3 = (0.05, 6.0, 0.05)

    def read(self, seen: Watched) -> Reading:
        energy = np.square(self.spun(seen)) @ self.inertia
        gain = energy - np.minimum.accumulate(energy)
        return Reading(100 * float(gain.max() / energy[0]), 0.0, 1e-6)


@dataclass(frozen=True)
class Gliding(StoppingDistance, name="gliding", quantity="height while it slides", unit="m"):
    """How far above its place at rest a slab is in the middle of its slide."""

    def measure(self, world: World) -> Reading:
        slide = self.speed / (self.friction * GRAVITY)
        seen = watch(world, 1.5 * slide)
        height = seen.bodies[:, 0, 2] - seen.bodies[-1, 0, 2]
        middle = (seen.t > 0.3 * slide) & (seen.t < 0.7 * slide)
        return Reading(float(height[middle].mean()), 0.0, 1e-6)


@dataclass(frozen=True)
class Rebound(
    Law, name="rebound", phenomenon="impact", quantity="speed after over before", unit=""
):
    """A ball let go: its speed after the first impact over that before."""

    height: float = 0.1
    restitution: float = 0.8

    def build(self) -> Scene:
        return let_go(self, self.height, self.restitution)

    def measure(self, world: World) -> Reading:
        fall = (2 * self.height / GRAVITY) ** 0.5
        speed = watch(world, 1.4 * fall).bodies[:, 0, 9]
        lowest = int(np.argmin(speed))
        return Reading(float(speed[lowest:].max() / -speed[lowest]), 0.0, 1e-6)


@dataclass(frozen=True)
class Pile(Task):
    """Cubes of 1 kg fall on each other, from places and attitudes that the seed draws.

    Attributes:
        cubes: how many.
        beside: others that lie 3 m away and touch nothing of it.
        seconds: that are watched.
        run: tells two alike apart.
    """

    name: ClassVar[str] = "pile"
    study_timeout: ClassVar[float] = 300.0
    repetitions: ClassVar[int] = 5

    cubes: int = 6
    beside: int = 0
    seconds: float = 1.0
    run: int = 1

    @property
    def metrics(self) -> tuple[Metric, ...]:
        return (
            Metric("gain", "gain of energy", "%", "lower", least=0.0, resolution=0.0),
            Metric("off", "off after a restore", "m", "lower", least=0.0, resolution=0.0),
        )

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        rng, bodies = np.random.default_rng(seed), []
        rows = 3 if self.cubes > 9 else 1  # of three cubes in a layer
        for k in range(self.cubes):
            x, y = rng.uniform(-0.008, 0.008, 2) + 0.19 * np.array([k % 3, k // 3 % rows])
            turn = rng.normal(size=4)
            at = Pose((float(x), float(y), 0.12 + 0.19 * (k // (3 * rows))), unit(turn))
            bodies.append(Box(f"cube {k}", (EDGE,) * 3, at, 1.0, 0.5))
        for k in range(self.beside):
            at = Pose.at(-3.0, 0.3 * k, EDGE / 2 + 0.1)
            bodies.append(Box(f"other {k}", (EDGE,) * 3, at, 1.0, 0.5))
        return Scene(self.name, tuple(bodies), ground_friction=0.5)

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        with world.phase("fall"):
            motion = world.wait(self.seconds, log_period=0.0)
        rows = motion.bodies[:, : self.cubes]
        return Outcome({"gain": _gain(rows), "off": None}, {"end": rows[-1].ravel().tolist()})


def unit(turn: FloatArray) -> tuple[float, float, float, float]:
    w, x, y, z = (turn / np.linalg.norm(turn)).tolist()
    return w, x, y, z


def _gain(rows: FloatArray) -> float:
    """By how much energy exceeds that of the first row at most [%]; rows (n, cubes, 13)."""
    falls = GRAVITY * rows[:, :, 2]
    moves = np.square(rows[:, :, 7:10]).sum(axis=2) / 2
    turns = EDGE**2 / 6 * np.square(rows[:, :, 10:13]).sum(axis=2) / 2
    energy = (falls + moves + turns).sum(axis=1)
    return 100 * max(0.0, float(energy.max() / energy[0] - 1))


@dataclass(frozen=True)
class Restored(Pile):
    """The same, saved while the cubes fall and restored a second later: how far is a cube from
    where it was at first?"""

    name: ClassVar[str] = "restored_pile"

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        def ends() -> Any:
            world.wait(self.seconds)
            return world.bodies[:, :7].copy()

        with world.phase("fall"):
            world.wait(0.15)
            world.save()
            first = ends()
            world.restore()
            again = ends()
        return Outcome({"gain": None, "off": float(np.abs(first - again).max())})


def apart(a: Any, b: Any) -> list[float]:
    """The largest difference of two results' ends, seed by seed."""
    ends = [{r.seed: np.array(r.details["end"]) for r in each.ok} for each in (a, b)]
    return [float(np.abs(ends[0][seed] - ends[1][seed]).max()) for seed in ends[0]]
