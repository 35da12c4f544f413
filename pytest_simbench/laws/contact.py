"""Laws of bodies that rest on each other, and of what they press with."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pytest_simbench.client.world import World
from pytest_simbench.laws.base import (
    GRAVITY,
    Law,
    Reading,
    Watched,
    rounding,
    solved,
    stillness,
    watch,
)
from pytest_simbench.laws.sticking import SHARES, fan, slopes
from pytest_simbench.scene import Box, FloatArray, Pose, Scene, Vector3, rotation_matrix
from pytest_simbench.simulator import Capability

EDGE = 0.1
CUBE: Vector3 = (EDGE,) * 3


@dataclass(frozen=True)
class _Stack(Law, phenomenon="stacking", quantity="way of the top cube", unit="m"):
    """Cubes upon each other; how far the top one is from its place."""

    masses: ClassVar[tuple[float, ...]]
    overhangs: ClassVar[tuple[float, ...]] = ()

    seconds: float = 1.0

    def build(self) -> Scene:
        aside = (0.0, *self.overhangs, *(0.0,) * len(self.masses))
        bodies = [
            Box(f"cube {k}", CUBE, Pose.at(sum(aside[: k + 1]), 0.0, EDGE * (k + 0.5)), mass)
            for k, mass in enumerate(self.masses)
        ]
        return Scene(self.name, tuple(bodies))

    def read(self, seen: Watched) -> Reading:
        off = float(np.linalg.norm(seen.bodies[-1, -1, :3] - seen.start[-1, :3]))
        n = len(self.masses)
        return Reading(off, 0.0, stillness(seen.dt, n * EDGE, n))


@dataclass(frozen=True)
class RestDepth(_Stack, masses=(1.0,)):
    """A cube put on the ground stays there: it neither sinks nor moves aside. Tolerance: an
    equilibrium, g dt^2."""


@dataclass(frozen=True)
class RestForce(
    _Stack, quantity="force upward", unit="N", needs=(Capability.CONTACT_FORCES,), masses=(1.0,)
):
    """The ground carries a cube at rest with m g (Newton's first law).

    The force is the mean of a time T after one of settling, step by step. By the law of momentum
    it is m g and m (v1 - v0) / T. Tolerance: both speeds are late by one step, g dt each:
    2 m g dt / T.
    """

    lowest: ClassVar[int] = 0
    """Of the cubes that are carried."""

    settling: float = 0.3
    seconds: float = 0.1

    def measure(self, world: World) -> Reading:
        dt = watch(world, self.settling).dt
        below = f"body/cube {self.lowest - 1}" if self.lowest else "ground"
        forces, count = [], max(1, round(self.seconds / dt))
        for _ in range(count):
            world.wait(dt)
            wrench = world.contact_forces().get((f"body/cube {self.lowest}", below))
            forces.append(0.0 if wrench is None else float(wrench[2]))
        weight = sum(self.masses[self.lowest :]) * GRAVITY
        allowed = 2 * weight / count + rounding(weight, 1)
        return Reading(float(np.mean(forces)), weight, allowed)


@dataclass(frozen=True)
class Tower(_Stack, masses=(1.0,) * 5):
    """A tower of five equal cubes stands. Tolerance: g dt^2 for each contact."""


@dataclass(frozen=True)
class TowerForce(RestForce, lowest=1, masses=(1.0,) * 4):
    """In a tower of four equal cubes the lowest carries the other three with 3 m g. Tolerance as of
    `RestForce`."""


@dataclass(frozen=True)
class HeavyOnTop(_Stack, masses=(1.0, 1.0, 1.0, 100.0)):
    """Three cubes of 1 kg carry one of 100 kg: masses do not matter to statics. Tolerance as of
    `Tower`. Solvers that iterate converge the slower, the larger the ratio of masses."""


@dataclass(frozen=True)
class Overhang(_Stack, masses=(1.0,) * 4):
    """Four cubes, each shifted on the one below by 0.9 of what statics allows, L / 2 (1, 1/2, 1/3)
    from the top (Coffin 1923; Paterson, Zwick, Overhang, 2009): the stack stands. Tolerance as of
    `Tower`."""

    overhangs: ClassVar[tuple[float, ...]] = tuple(0.9 * EDGE / 2 / k for k in (3, 2, 1))


@dataclass(frozen=True)
class TippingEdge(Law, phenomenon="stacking", quantity="largest overhang that stands", unit="m"):
    """A cube that lies over an edge tips when its centre is beyond it: six cubes, whose overhang is
    0.92 to 1.08 of half their length. One has tipped that is turned by 0.05 rad. Tolerance: half of
    the gap between those on either side, 0.02 of it; no step."""

    seconds: float = 0.8

    def build(self) -> Scene:
        bodies = []
        for k, share in enumerate(SHARES):
            y = 0.5 * (k - 2.5)
            bodies.append(Box(f"table {k}", (0.3, 0.3, 0.5), Pose.at(0.0, y, 0.25)))
            place = Pose.at(0.15 + (share - 1) * EDGE / 2, y, 0.5 + EDGE / 2)
            bodies.append(Box(f"cube {k}", CUBE, place, 1.0))
        return Scene(self.name, tuple(bodies))

    def read(self, seen: Watched) -> Reading:
        return fan(EDGE / 2, [tilt(row) > 0.05 for row in seen.bodies[-1]])


@dataclass(frozen=True)
class TippingSlope(
    Law, phenomenon="stacking", quantity="tangent of the steepest slope that holds", unit=""
):
    """A tall block on a slope tips, and does not slide, when the slope's tangent is above its width
    over its height, and mu is more than that: six slopes. Turned by 0.05 rad it has tipped.
    Tolerance: half of the gap between the slopes on either side; no step."""

    size: Vector3 = (0.1, 0.1, 0.25)
    seconds: float = 0.8

    def build(self) -> Scene:
        return slopes(self.name, self.size[0] / self.size[2], self.size, 0.0, 1.0)

    def read(self, seen: Watched) -> Reading:
        turned = []
        for rows in zip(seen.start, seen.bodies[-1], strict=True):
            before, now = (rotation_matrix(row[3:7])[:, 2] for row in rows)
            turned.append(math.acos(min(1.0, float(before @ now))) > 0.05)
        return fan(self.size[0] / self.size[2], turned)


def tilt(row: FloatArray) -> float:
    """Of a body's upper face from the horizontal [rad]."""
    return math.acos(min(1.0, max(-1.0, float(rotation_matrix(row[3:7])[2, 2]))))


@dataclass(frozen=True)
class Pivot(Law, phenomenon="rolling", quantity="angle turned", unit="rad"):
    """A plank that stands on an edge, leaning, turns about that edge: (I + m r^2) x'' = m g r cos
    x, with x the angle of its centre above the edge; friction 1 holds the edge. Against DOP853.
    Tolerance: late by one step and a rate late by one step all the time: |v| dt + |a| t dt."""

    size: Vector3 = (0.4, 0.2, 0.1)
    lean: float = math.radians(60.0)
    seconds: float = 0.3

    def build(self) -> Scene:
        half = self.lean / 2
        turn = Pose(quaternion=(math.cos(half), 0.0, -math.sin(half), 0.0))  # the far end up
        corner = turn.rotation() @ [-self.size[0] / 2, 0.0, -self.size[2] / 2]
        place = Pose((0.0, 0.0, float(-corner[2])), turn.quaternion)
        return Scene(self.name, (Box("plank", self.size, place, 1.0),))

    def exact(self, seconds: float) -> tuple[float, float, float]:
        """Angle turned [rad], the largest rate [rad/s] and acceleration [rad/s^2]."""
        length, _, height = self.size
        radius = math.hypot(length, height) / 2
        inertia = (length**2 + height**2) / 12 + radius**2
        start = self.lean + math.atan2(height, length)

        def fall(_: float, state: FloatArray) -> FloatArray:
            return np.array([state[1], -GRAVITY * radius * math.cos(state[0]) / inertia])

        angle, rate = solved(fall, [start, 0.0], seconds)[-1]
        return start - float(angle), abs(float(rate)), GRAVITY * radius / inertia

    def read(self, seen: Watched) -> Reading:
        t = seen.end
        before, now = (rotation_matrix(row[0, 3:7])[:, 0] for row in (seen.start, seen.bodies[-1]))
        along = before @ now
        exact, rate, change = self.exact(t)
        return seen.reading(math.acos(min(1.0, float(along))), exact, (rate + change * t), 1.0)
