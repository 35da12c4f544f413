"""Laws of what rolls: round bodies, which may slip first, and a wheel without a rim."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from pytest_simbench.client.world import World
from pytest_simbench.laws.base import GRAVITY, Law, Reading, Watched, watch
from pytest_simbench.laws.sliding import TOP, BeltSpeed
from pytest_simbench.laws.sticking import acceleration, tilted
from pytest_simbench.scene import Body, ConvexMesh, Cylinder, Pose, Scene, Sphere

RADIUS = 0.05
ON_ITS_SIDE = Pose((0.0, 0.0, RADIUS), (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0))
"""Of a cylinder whose axis is y."""


@dataclass(frozen=True)
class RollingSphere(Law, phenomenon="rolling", quantity="acceleration", unit="m/s^2"):
    """Down a slope a sphere rolls without slipping with a = 5/7 g sin a, where mu is more than 2/7
    of the slope (I = 2/5 m r^2). Tolerance: its speed is late by one step at either end of the time
    T over which it is taken, under the largest of the forces: 2 g sin a dt / T."""

    share: ClassVar[float] = 5 / 7
    slope: float = 0.3
    friction: float = 0.5
    seconds: float = 0.8

    def body(self) -> Body:
        return Sphere("ball", RADIUS, Pose.at(0.0, 0.0, RADIUS), 1.0, self.friction)

    def build(self) -> Scene:
        gravity = tilted(self.slope, 0.0)
        return Scene(self.name, (self.body(),), gravity=gravity, ground_friction=self.friction)

    def read(self, seen: Watched) -> Reading:
        pull = GRAVITY * math.sin(math.atan(self.slope))
        return acceleration(seen, seen.bodies[:, 0, 7], 0.2, self.share * pull, pull)


@dataclass(frozen=True)
class RollingCylinder(RollingSphere, share=2 / 3):
    """A cylinder rolls with a = 2/3 g sin a (I = m r^2 / 2). Tolerance as of `RollingSphere`."""

    def body(self) -> Body:
        return Cylinder("roller", RADIUS, 0.2, ON_ITS_SIDE, 1.0, self.friction)


@dataclass(frozen=True)
class SlipToRoll(Law, phenomenon="rolling", quantity="speed", unit="m/s"):
    """A sphere that is pushed off with v0 and w0 slips until it rolls, with (5 v0 + 2 w0 r) / 7,
    whatever mu (angular momentum about the ground; Coriolis, Billard, 1835). Tolerance: its speed
    is late by one step, mu g dt."""

    speed: float = 1.0
    spin: float = 0.0
    friction: float = 0.3
    seconds: float = 0.5

    def build(self) -> Scene:
        ball = Sphere("ball", RADIUS, Pose.at(0.0, 0.0, RADIUS), 1.0, self.friction)
        v, w = (self.speed, 0.0, 0.0), (0.0, self.spin, 0.0)
        pushed = replace(ball, linear_velocity=v, angular_velocity=w)
        return Scene(self.name, (pushed,), ground_friction=self.friction)

    def read(self, seen: Watched) -> Reading:
        exact = (5 * self.speed + 2 * self.spin * RADIUS) / 7
        return seen.reading(seen.bodies[-1, 0, 7], exact, self.friction * GRAVITY, 1.0)


@dataclass(frozen=True)
class SpinToRoll(SlipToRoll):
    """A sphere that only spins about a level axis runs off: the same with v0 = 0. Tolerance
    as of `SlipToRoll`."""

    speed: float = 0.0
    spin: float = 40.0


@dataclass(frozen=True)
class BallOnBelt(BeltSpeed, phenomenon="rolling", quantity="speed", unit="m/s"):
    """A ball laid on a running belt comes to roll on it with 2/7 of the belt's speed: friction
    gives it m v and turns it back by 2/5 m r^2 w = m v r until v + w r is that of the belt.
    Tolerance: its speed is late by one step, mu g dt."""

    def body(self) -> Body:
        return Sphere("ball", RADIUS, Pose.at(0.0, 0.0, TOP + RADIUS), 0.5, self.friction)

    def read(self, seen: Watched) -> Reading:
        return seen.reading(seen.bodies[-1, 1, 7], 2 / 7 * self.speed, self.friction * GRAVITY, 1.0)


@dataclass(frozen=True)
class RimlessWheel(
    Law, phenomenon="rolling", quantity="angular speed above the next edge", unit="rad/s"
):
    """A regular prism of n sides rolls on its edges: a step of a wheel without a rim.

    It turns about an edge (r to the axis, J about it) until the next edge strikes, 2 pi / n
    further. That one is where all impulses act, so angular momentum about it stays, and of the
    speed there is left k = (J + m r^2 cos(2 pi / n)) / (J + m r^2) (McGeer, Passive dynamic
    walking, Int. J. Robotics Research 9 (1990) 62). Before and after it energy stays, with a = m g
    r / (J + m r^2): w0^2 + 2 a (cos x0 - cos x) = w^2, x from the vertical. J = m r^2 (2 + cos(2 pi
    / n)) / 6 of a regular polygon. Measured where the axis is above the new edge. Friction 1 holds
    the edges, and w^2 r stays below g cos x, so that none lifts off.

    Tolerance: each of the two falls is late by one step, a dt, and its rate one step late all the
    time, a w T dt; the impact is late by one step, a dt; an error of the speed before is k of it
    after, and grows by w / w_top until the top.
    """

    sides: int = 8
    radius: float = 0.2
    width: float = 0.2
    lean: float = 0.1
    speed: float = 4.5

    def build(self) -> Scene:
        turns = 2 * np.pi * np.arange(self.sides) / self.sides
        vertices = tuple(
            (float(self.radius * np.sin(turn)), y, float(-self.radius * np.cos(turn)))
            for turn in turns
            for y in (-self.width / 2, self.width / 2)
        )
        x, z = self.radius * math.sin(self.lean), self.radius * math.cos(self.lean)
        half = self.lean / 2
        wheel = ConvexMesh(
            "wheel",
            vertices,
            Pose((x, 0.0, z), (math.cos(half), 0.0, math.sin(half), 0.0)),
            1.0,
            linear_velocity=(self.speed * z, 0.0, -self.speed * x),
            angular_velocity=(0.0, self.speed, 0.0),
        )
        return Scene(self.name, (wheel,))

    def exact(self) -> tuple[float, float, float]:
        """Angular speed above the next edge, and just before and after the impact [rad/s]."""
        step = 2 * math.pi / self.sides
        own = (2 + math.cos(step)) / 6  # of J, in m r^2
        fall = 2 * self.pull
        before = math.sqrt(self.speed**2 + fall * (math.cos(self.lean) - math.cos(step / 2)))
        after = before * (own + math.cos(step)) / (own + 1)
        return math.sqrt(after**2 - fall * (1 - math.cos(step / 2))), before, after

    @property
    def pull(self) -> float:
        """a, the largest angular acceleration [rad/s^2]."""
        return GRAVITY / self.radius / ((2 + math.cos(2 * math.pi / self.sides)) / 6 + 1)

    def measure(self, world: World) -> Reading:
        step = 2 * math.pi / self.sides
        top, before, after = self.exact()
        first, second = (step / 2 - self.lean) / self.speed, step / 2 / top  # at most [s]
        seen = watch(world, first + second + 0.1)
        halves = np.arctan2(seen.bodies[:, 0, 5], seen.bodies[:, 0, 3])
        angles = np.unwrap(2 * halves)
        reached = seen.crossings(angles, step)
        found = float(seen.at(reached[0], seen.bodies[:, 0, 11])) if len(reached) else 0.0
        late, rate = self.pull, self.pull * before
        off = (after / before) * (late + rate * first) + late
        return seen.reading(found, top, (after / top) * off + late + rate * second, before)
