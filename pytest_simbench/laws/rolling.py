"""Laws of round bodies: what rolls, and what slips before it rolls."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from pytest_simbench.client.world import World
from pytest_simbench.laws.base import GRAVITY, Law, Reading, rounding, watch
from pytest_simbench.laws.free import WEIGHTLESS
from pytest_simbench.laws.friction import acceleration, tilted
from pytest_simbench.laws.spinning import FreeTop
from pytest_simbench.scene import Body, Cylinder, Pose, Scene, Sphere

RADIUS = 0.05
ON_ITS_SIDE = Pose((0.0, 0.0, RADIUS), (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0))
"""Of a cylinder whose axis is y."""


@dataclass(frozen=True)
class RollingSphere(Law):
    """Down a slope a sphere rolls without slipping with a = 5/7 g sin a, where mu is more than 2/7
    of the slope (I = 2/5 m r^2). Tolerance: its speed is late by one step at either end of the time
    T over which it is taken, under the largest of the forces: 2 g sin a dt / T."""

    name = "rolling_sphere"
    phenomenon = "rolling"
    quantity: ClassVar[str] = "acceleration"
    unit: ClassVar[str] = "m/s^2"

    share: ClassVar[float] = 5 / 7
    slope: float = 0.3
    friction: float = 0.5
    seconds: float = 0.8

    def body(self) -> Body:
        return Sphere("ball", RADIUS, Pose.at(0.0, 0.0, RADIUS), 1.0, self.friction)

    def build(self) -> Scene:
        return Scene(
            self.name,
            (self.body(),),
            gravity=tilted(self.slope, 0.0),
            ground_friction=self.friction,
        )

    def measure(self, world: World) -> Reading:
        seen = watch(world, self.seconds)
        pull = GRAVITY * math.sin(math.atan(self.slope))
        return acceleration(seen.dt, seen.t, seen.bodies[:, 0, 7], 0.2, self.share * pull, pull)


@dataclass(frozen=True)
class RollingCylinder(RollingSphere):
    """A cylinder rolls with a = 2/3 g sin a (I = m r^2 / 2). Tolerance as of `RollingSphere`."""

    name = "rolling_cylinder"
    share: ClassVar[float] = 2 / 3

    def body(self) -> Body:
        return Cylinder("roller", RADIUS, 0.2, ON_ITS_SIDE, 1.0, self.friction)


@dataclass(frozen=True)
class SlipToRoll(Law):
    """A sphere that is pushed off with v0 and w0 slips until it rolls, with (5 v0 + 2 w0 r) / 7,
    whatever mu (angular momentum about the ground; Coriolis, Billard, 1835). Tolerance: its speed
    is late by one step, mu g dt."""

    name = "slip_to_roll"
    phenomenon = "rolling"
    quantity: ClassVar[str] = "speed"
    unit: ClassVar[str] = "m/s"

    speed: float = 1.0
    spin: float = 0.0
    friction: float = 0.3
    seconds: float = 0.5

    def build(self) -> Scene:
        ball = Sphere(
            "ball",
            RADIUS,
            Pose.at(0.0, 0.0, RADIUS),
            1.0,
            self.friction,
            linear_velocity=(self.speed, 0.0, 0.0),
            angular_velocity=(0.0, self.spin, 0.0),
        )
        return Scene(self.name, (ball,), ground_friction=self.friction)

    def measure(self, world: World) -> Reading:
        seen = watch(world, self.seconds)
        exact = (5 * self.speed + 2 * self.spin * RADIUS) / 7
        allowed = self.friction * GRAVITY * seen.dt + rounding(1.0, seen.steps)
        return Reading(float(seen.bodies[-1, 0, 7]), exact, allowed)


@dataclass(frozen=True)
class SpinToRoll(SlipToRoll):
    """A sphere that only spins about a level axis runs off: the same with v0 = 0. Tolerance
    as of `SlipToRoll`."""

    name = "spin_to_roll"

    speed: float = 0.0
    spin: float = 40.0


@dataclass(frozen=True)
class FreeCylinder(FreeTop):
    """The same for a cylinder (I1 = m (3 r^2 + l^2) / 12, I3 = m r^2 / 2).
    Tolerance as of `FreeTop`."""

    name = "free_cylinder"

    def build(self) -> Scene:
        body = Cylinder("rod", 0.05, 0.4, Pose.at(0.0, 0.0, 2.0), 1.0, angular_velocity=self.omega)
        return Scene(self.name, (body,), gravity=WEIGHTLESS)
