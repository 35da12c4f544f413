"""Laws of free motion: nothing touches anything."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from pytest_simbench.client.world import World
from pytest_simbench.laws.base import GRAVITY, Law, Reading, rounding, watch
from pytest_simbench.scene import Box, FloatArray, Pose, Scene, Vector3

FREE = "free motion"
OPEN: Vector3 = (1e3, 1e3, 1e3)
"""A room without walls [m]."""

WEIGHTLESS: Vector3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class FreeFall(Law):
    """A body that is let go falls s = g t^2 / 2 (Galilei). Tolerance: its speed is late by one step
    all the time, g t dt; semi-implicit Euler's is g t dt / 2."""

    name = "free_fall"
    phenomenon = FREE
    quantity: ClassVar[str] = "height fallen"
    unit: ClassVar[str] = "m"

    seconds: float = 1.0

    def build(self) -> Scene:
        return Scene(self.name, (Box("body", (0.1,) * 3, Pose.at(0.0, 0.0, 8.0), 1.0),))

    def measure(self, world: World) -> Reading:
        seen = watch(world, self.seconds)
        t = float(seen.t[-1])
        fallen = 8.0 - float(seen.bodies[-1, 0, 2])
        allowed = GRAVITY * t * seen.dt + rounding(8.0, seen.steps)
        return Reading(fallen, GRAVITY * t * t / 2, allowed)


@dataclass(frozen=True)
class FallSpeed(FreeFall):
    """It then has the speed v = g t: nothing damps it. Tolerance: late by one step, g dt."""

    name = "fall_speed"
    quantity: ClassVar[str] = "speed of the fall"
    unit: ClassVar[str] = "m/s"

    def measure(self, world: World) -> Reading:
        seen = watch(world, self.seconds)
        t = float(seen.t[-1])
        allowed = GRAVITY * seen.dt + rounding(GRAVITY * t, seen.steps)
        return Reading(-float(seen.bodies[-1, 0, 9]), GRAVITY * t, allowed)


@dataclass(frozen=True)
class DampedFall(FreeFall):
    """A body that is damped by c v / m falls ever less fast, v = (g / c) (1 - exp(-c t)), towards
    its terminal speed g / c (Stokes' law of resistance). Tolerance: late by one step, g dt."""

    name = "damped_fall"
    quantity: ClassVar[str] = "speed of the fall"
    unit: ClassVar[str] = "m/s"

    damping: float = 2.0

    def build(self) -> Scene:
        body = Box("body", (0.1,) * 3, Pose.at(0.0, 0.0, 8.0), 1.0, linear_damping=self.damping)
        return Scene(self.name, (body,))

    def measure(self, world: World) -> Reading:
        seen = watch(world, self.seconds)
        exact = GRAVITY / self.damping * -math.expm1(-self.damping * float(seen.t[-1]))
        allowed = GRAVITY * seen.dt + rounding(exact, seen.steps)
        return Reading(-float(seen.bodies[-1, 0, 9]), exact, allowed)


@dataclass(frozen=True)
class ObliqueGravity(Law):
    """Gravity has three components: after t a body has moved by g t^2 / 2 in each; the distance
    between where it is and where it should be is 0. Tolerance as of `FreeFall`."""

    name = "oblique_gravity"
    phenomenon = FREE
    quantity: ClassVar[str] = "distance from the place"
    unit: ClassVar[str] = "m"

    gravity: Vector3 = (1.0, -2.0, -4.0)
    seconds: float = 1.0

    def build(self) -> Scene:
        body = Box("body", (0.1,) * 3, Pose.at(0.0, 0.0, 8.0), 1.0)
        return Scene(self.name, (body,), gravity=self.gravity)

    def measure(self, world: World) -> Reading:
        seen = watch(world, self.seconds)
        t = float(seen.t[-1])
        place = np.array([0.0, 0.0, 8.0]) + np.array(self.gravity) * t * t / 2
        off = float(np.linalg.norm(seen.bodies[-1, 0, :3] - place))
        pull = float(np.linalg.norm(self.gravity))
        return Reading(off, 0.0, pull * t * seen.dt + rounding(8.0, seen.steps))


@dataclass(frozen=True)
class Projectile(Law):
    """A thrown body flies p0 + v t + g t^2 / 2 and turns about a principal axis by w t: where it is
    after 1 s, in all six components (an angle counts as the way of a point 1 m from the axis).
    Tolerance as of `FreeFall`, and the turn late by one step, w dt."""

    name = "projectile"
    phenomenon = FREE
    quantity: ClassVar[str] = "distance from the place, turn included"
    unit: ClassVar[str] = "m"

    velocity: Vector3 = (2.0, -1.5, 4.0)
    spin: float = 3.0
    seconds: float = 1.0

    def build(self) -> Scene:
        body = Box(
            "body",
            (0.3, 0.2, 0.1),
            Pose.at(0.0, 0.0, 2.0),
            1.0,
            linear_velocity=self.velocity,
            angular_velocity=(0.0, 0.0, self.spin),
        )
        return Scene(self.name, (body,))

    def measure(self, world: World) -> Reading:
        seen = watch(world, self.seconds)
        t, row = float(seen.t[-1]), seen.bodies[-1, 0]
        place = np.array([0.0, 0.0, 2.0]) + np.array(self.velocity) * t
        place[2] -= GRAVITY * t * t / 2
        turned = rotation_of(row[3:7]) * Rotation.from_rotvec([0.0, 0.0, -self.spin * t])
        off = math.hypot(float(np.linalg.norm(row[:3] - place)), float(turned.magnitude()))
        allowed = (GRAVITY * t + self.spin) * seen.dt + rounding(5.0, seen.steps)
        return Reading(off, 0.0, allowed)


def rotation_of(quaternion: FloatArray) -> Rotation:
    """Of quaternions w, x, y, z, (4,) or (n, 4)."""
    return Rotation.from_quat(np.roll(quaternion, -1, axis=-1))
