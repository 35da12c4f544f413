"""Laws of sticking: what friction holds. And what all laws of friction share: slabs on slopes, fans
of cases around a critical value."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pytest_simbench.laws.base import GRAVITY, Law, Reading, Watched, stillness
from pytest_simbench.laws.mechanisms import STRONG, Part, mechanism
from pytest_simbench.scene import Box, FloatArray, Pose, Scene, Trajectory, Vector3

SLAB: Vector3 = (0.1, 0.1, 0.02)
SLAB_AT = Pose.at(0.0, 0.0, SLAB[2] / 2)
WEDGE: Vector3 = (0.3, 0.3, 0.05)


def tilted(slope: float, direction: float) -> Vector3:
    """Gravity that makes the ground a slope [tangent], down towards `direction` [rad]."""
    angle = math.atan(slope)
    pull = GRAVITY * math.sin(angle)
    down = -GRAVITY * math.cos(angle)
    return pull * math.cos(direction), pull * math.sin(direction), down


def slab_on(name: str, slope: float, direction: float, friction: float) -> Scene:
    """A slab of 1 kg at rest on such a slope, with one friction for both."""
    slab = Box("slab", SLAB, SLAB_AT, 1.0, friction)
    return Scene(name, (slab,), gravity=tilted(slope, direction), ground_friction=friction)


SHARES = (0.92, 0.96, 0.98, 1.02, 1.04, 1.08)
"""Of a critical value: a fan of cases on both sides of it."""


def slopes(name: str, critical: float, size: Vector3, direction: float, friction: float) -> Scene:
    """Such a fan of slopes [tangents], down towards `direction` [rad], a box of 1 kg on each."""
    bodies = []
    for k, share in enumerate(SHARES):
        half = math.atan(share * critical) / 2
        down = Pose(quaternion=(math.cos(half), 0.0, math.sin(half), 0.0))
        place = Pose.at(0.6 * (k % 2), 0.5 * (k - 2.5), 1.0, yaw=direction) * down
        on_top = place * Pose.at(0.0, 0.0, (WEDGE[2] + size[2]) / 2)
        bodies.append(Box(f"slope {k}", WEDGE, place, friction=friction))
        bodies.append(Box(f"slab {k}", size, on_top, 1.0, friction))
    return Scene(name, tuple(bodies), ground_friction=friction)


BETWEEN = 0.02
"""Tolerance of a fan: half of the gap in which the critical value lies, as a share of it."""


def fan(critical: float, moved: Sequence[bool]) -> Reading:
    """The value at which a fan of cases, in the order of `SHARES`, changes from what stays to what
    moves: in the middle between the two neighbours, at an end where all stay or all move. Where one
    moves before another that stays, that below the first or above the last, whichever is farther
    off."""
    values = [share * critical for share in SHARES]
    middles = [values[0], *((a + b) / 2 for a, b in pairwise(values)), values[-1]]
    first = [*moved, True].index(True)
    last = len(values) - [*reversed(moved), False].index(False)
    found = max(middles[first], middles[last], key=lambda value: abs(value - critical))
    return Reading(found, critical, BETWEEN * critical)


def acceleration(
    seen: Watched, speed: FloatArray, begin: float, exact: float, force: float
) -> Reading:
    """The slope of a speed [m/s] from `begin` [s] to the end; `force`: the largest one, for each
    kg [m/s^2]."""
    used = seen.t > begin
    found = float(np.polyfit(seen.t[used], speed[used], 1)[0])
    return seen.reading(found, exact, 2 * force / (seen.end - begin), 1.0)


@dataclass(frozen=True)
class StickAngleX(
    Law, phenomenon="sticking", quantity="tangent of the steepest slope that holds", unit=""
):
    """A slab on a slope stays up to the angle atan mu and slides above it (Coulomb; Amontons): six
    slopes, from 0.92 to 1.08 mu. It slides where it has gone half as far as the least steep one
    that must. Tolerance: half of the gap between the slopes on either side, 0.02 mu; no step."""

    direction: float = 0.0
    friction: float = 0.5
    seconds: float = 0.8

    def build(self) -> Scene:
        return slopes(self.name, self.friction, SLAB, self.direction, self.friction)

    def read(self, seen: Watched) -> Reading:
        moved = np.linalg.norm(seen.bodies[-1, :, :3] - seen.start[:, :3], axis=1)
        steep = math.atan(self.friction)
        pull = GRAVITY * math.cos(steep) * BETWEEN * self.friction
        least = pull * seen.end**2 / 4
        return fan(self.friction, [bool(way > least) for way in moved])


@dataclass(frozen=True)
class StickAngleY(StickAngleX):
    """The same in the direction y."""

    direction: float = math.pi / 2


@dataclass(frozen=True)
class StickAngleDiagonal(StickAngleX):
    """The same along a diagonal, where a friction pyramid holds up to sqrt(2) mu, or only up to
    mu / sqrt(2)."""

    direction: float = math.pi / 4


@dataclass(frozen=True)
class Creep(Law, phenomenon="sticking", quantity="way in 1 s", unit="m", seconds=1.2):
    """A slab on a slope of 0.8 mu stays where it is. Tolerance: an equilibrium, g dt^2; it is
    looked at from 0.2 s on."""

    friction: float = 0.5
    share: float = 0.8
    direction: float = 0.4

    def build(self) -> Scene:
        return slab_on(self.name, self.share * self.friction, self.direction, self.friction)

    def read(self, seen: Watched) -> Reading:
        way = seen.bodies[-1, 0, :2] - seen.at(0.2, seen.bodies[:, 0, :2])
        allowed = stillness(seen.dt, 0.1)
        return Reading(float(np.linalg.norm(way)), 0.0, allowed)


@dataclass(frozen=True)
class Carried(Law, phenomenon="sticking", quantity="way on the carriage", unit="m"):
    """A box on a carriage that starts with less than mu g goes with it: it stays where it lies on
    the carriage. Tolerance: an equilibrium in the carriage's frame, g dt^2, and the carriage's
    motion late by one step, a dt^2."""

    friction: float = 0.5
    acceleration: float = 2.0
    seconds: float = 0.5

    def build(self) -> Scene:
        deck = Part(
            "carriage", (1.0, 0.0, 0.0), mass=5.0, inertia=(0.1,) * 3, slides=True,
            shape=(2.0, 0.4, 0.1), stiffness=1e5, damping=2e3, effort=STRONG,
        )  # fmt: skip
        robot = mechanism("belt", deck, base=Pose.at(0.0, 0.0, 0.5), friction=self.friction)
        box = Box("box", SLAB, Pose.at(0.0, 0.0, 0.55 + SLAB[2] / 2), 0.2, self.friction)
        return Scene(self.name, (box,), robot, ground_friction=self.friction)

    def commands(self) -> Trajectory:
        """The carriage's set points, with the force that its mass asks for."""
        time = np.linspace(0.0, self.seconds, 101)
        a = self.acceleration
        position, velocity = a * time**2 / 2, a * time
        effort = np.full((101, 1), 5.0 * a)
        return Trajectory(float(time[1]), position[:, None], velocity[:, None], effort)

    def read(self, seen: Watched) -> Reading:
        slid = float(seen.bodies[-1, 0, 0] - seen.joints[-1, 0, 0])
        allowed = stillness(seen.dt, 1.0) + self.acceleration * seen.dt**2
        return Reading(slid, 0.0, allowed)
