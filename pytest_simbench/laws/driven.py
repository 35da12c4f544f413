"""Laws of bodies that move as prescribed, and of what lies on them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pytest_simbench.client.world import World
from pytest_simbench.laws.base import GRAVITY, Law, Reading, rounding, watch
from pytest_simbench.scene import Body, Box, Pose, Scene, Sphere

RADIUS = 0.05
TOP = 0.5
"""Height of the belt's upper side [m]."""


@dataclass(frozen=True)
class BeltSpeed(Law):
    """A box laid on a running belt slips until it has the belt's speed: a distance x = v^2 / (2 mu
    g) from where it was laid (Coulomb's friction does the work of the kinetic energy), and goes on
    with the belt from v / (mu g) on. Its place is read when it goes with the belt. Tolerance: its
    speed is late by one step all the time, v dt."""

    name = "belt_speed"
    phenomenon = "sliding"
    quantity: ClassVar[str] = "way"
    unit: ClassVar[str] = "m"

    speed: float = 0.8
    friction: float = 0.4
    seconds: float = 0.6

    def body(self) -> Body:
        return Box("box", (0.1, 0.1, 0.05), Pose.at(0.0, 0.0, TOP + 0.025), 0.5, self.friction)

    def build(self) -> Scene:
        belt = Box(
            "belt",
            (4.0, 0.4, 0.1),
            Pose.at(0.0, 0.0, TOP - 0.05),
            friction=self.friction,
            linear_velocity=(self.speed, 0.0, 0.0),
            prescribed=True,
        )
        return Scene(self.name, (belt, self.body()), ground_friction=self.friction)

    def measure(self, world: World) -> Reading:
        seen = watch(world, self.seconds)
        t, slips = float(seen.t[-1]), self.speed / (self.friction * GRAVITY)
        exact = self.speed * (t - slips / 2)
        allowed = self.speed * seen.dt + rounding(1.0, seen.steps)
        return Reading(float(seen.bodies[-1, 1, 0]), exact, allowed)


@dataclass(frozen=True)
class BallOnBelt(BeltSpeed):
    """A ball laid on a running belt comes to roll on it with 2/7 of the belt's speed: friction
    gives it m v and turns it back by 2/5 m r^2 w = m v r until v + w r is that of the belt.
    Tolerance: its speed is late by one step, mu g dt."""

    name = "ball_on_belt"
    phenomenon = "rolling"
    quantity: ClassVar[str] = "speed"
    unit: ClassVar[str] = "m/s"

    def body(self) -> Body:
        return Sphere("ball", RADIUS, Pose.at(0.0, 0.0, TOP + RADIUS), 0.5, self.friction)

    def measure(self, world: World) -> Reading:
        seen = watch(world, self.seconds)
        allowed = self.friction * GRAVITY * seen.dt + rounding(1.0, seen.steps)
        return Reading(float(seen.bodies[-1, 1, 7]), 2 / 7 * self.speed, allowed)
