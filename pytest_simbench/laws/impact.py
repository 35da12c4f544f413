"""Laws of impacts, dead ones and such that bounce."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from pytest_simbench.client.world import World
from pytest_simbench.laws.base import GRAVITY, Law, Reading, Watched, watch
from pytest_simbench.laws.contact import CUBE, EDGE
from pytest_simbench.scene import Box, Pose, Scene, Sphere

RADIUS = 0.05
"""[m]."""


def let_go(
    law: Law, height: float, restitution: float, friction: float = 1.0, **values: Any
) -> Scene:
    """A ball of 1 kg so high above the ground [m]; both have these."""
    place = Pose.at(0.0, 0.0, RADIUS + height)
    ball = Sphere("ball", RADIUS, place, 1.0, friction, restitution=restitution, **values)
    return Scene(law.name, (ball,), ground_friction=friction, ground_restitution=restitution)


@dataclass(frozen=True)
class LandingTime(Law, phenomenon="impact", quantity="time of the landing", unit="s"):
    """A cube let go at the height h lands after sqrt(2 h / g): its speed is the largest then.
    Tolerance: late by one step, and read to one step."""

    height: float = 0.5

    def build(self) -> Scene:
        cube = Box("cube", CUBE, Pose.at(0.0, 0.0, EDGE / 2 + self.height), 1.0)
        return Scene(self.name, (cube,))

    def measure(self, world: World) -> Reading:
        seen = watch(world, 1.5 * math.sqrt(2 * self.height / GRAVITY))
        found = float(seen.t[int(np.argmin(seen.bodies[:, 0, 9]))])
        return Reading(found, math.sqrt(2 * self.height / GRAVITY), 2 * seen.dt)


@dataclass(frozen=True)
class DeadLanding(LandingTime, quantity="rise after the landing", unit="m"):
    """It does not rise again: e = 0 (Newton). Tolerance: the impact is late by one step, so that
    it is pushed out of the ground by v dt."""

    def measure(self, world: World) -> Reading:
        fall = math.sqrt(2 * self.height / GRAVITY)
        seen = watch(world, 2 * fall)
        landed = seen.bodies[seen.t > 1.1 * fall, 0, 2] - EDGE / 2
        rise = max(0.0, float(landed.max()))
        return seen.reading(rise, 0.0, GRAVITY * fall, 1.0)


@dataclass(frozen=True)
class _Collision(Law, phenomenon="impact", unit="m/s", seconds=0.3):
    """A cube hits another one that is at rest, face on face, on ground without friction."""

    masses: ClassVar[tuple[float, float]] = (1.0, 2.0)

    speed: float = 1.0

    @property
    def common(self) -> float:
        """Speed of the common centre of mass [m/s]."""
        return self.speed * self.masses[0] / sum(self.masses)

    def build(self) -> Scene:
        at = Pose.at(0.0, 0.0, EDGE / 2)
        velocity = (self.speed, 0.0, 0.0)
        one = Box("one", CUBE, at, self.masses[0], 0.0, linear_velocity=velocity)
        two = Box("two", CUBE, at.translated(EDGE + 0.1), self.masses[1], 0.0)
        return Scene(self.name, (one, two), ground_friction=0.0)


@dataclass(frozen=True)
class DeadCollision(_Collision, quantity="speed of the cube that was hit"):
    """With e = 0 both go on with the common speed m1 v / (m1 + m2). Tolerance: what gravity changes
    within one step, g dt: an impact is solved at once, whatever the step."""

    def read(self, seen: Watched) -> Reading:
        return seen.reading(seen.bodies[-1, 1, 7], self.common, GRAVITY, 1.0)


@dataclass(frozen=True)
class CollisionMomentum(_Collision, quantity="speed of the common centre of mass"):
    """Whatever else happens, momentum stays: (m1 v1 + m2 v2) / (m1 + m2) is what it was. Tolerance
    as of `DeadCollision`."""

    def read(self, seen: Watched) -> Reading:
        found = float(seen.bodies[-1, :, 7] @ self.masses) / sum(self.masses)
        return seen.reading(found, self.common, 0.0, 2.0)


@dataclass(frozen=True)
class BounceHeight(Law, phenomenon="impact", quantity="height of the bounce", unit="m"):
    """A ball let go at the height h rises again to e^2 h (Newton's coefficient of restitution).
    Tolerance: the impact is late by one step, in its place and in its speed, 2 v dt."""

    restitution: float = 0.8
    height: float = 0.5

    def build(self) -> Scene:
        return let_go(self, self.height, self.restitution)

    @property
    def fall(self) -> float:
        """Time of the fall [s]."""
        return math.sqrt(2 * self.height / GRAVITY)

    def rises(self, seen: Watched) -> tuple[float, float]:
        """Heights of the first and the second bounce [m], looked for when they should be."""
        e, t, z = self.restitution, seen.t, seen.bodies[:, 0, 2] - RADIUS
        first = (t > self.fall) & (t < self.fall * (1 + 2 * e))
        second = t > self.fall * (1 + 2 * e)
        return float(z[first].max()), float(z[second].max(initial=0.0))

    def measure(self, world: World) -> Reading:
        seen = watch(world, self.fall * (1 + 2 * self.restitution))
        return seen.reading(
            self.rises(seen)[0], self.restitution**2 * self.height, 2 * GRAVITY * self.fall, 1.0
        )


@dataclass(frozen=True)
class BounceRatio(BounceHeight, quantity="second bounce over the first", unit=""):
    """Each bounce is e^2 times as high as the one before. Tolerance: twice that of a bounce, as a
    share of the first."""

    def measure(self, world: World) -> Reading:
        e = self.restitution
        seen = watch(world, self.fall * (1 + 2 * e + 2 * e**2))
        first, second = self.rises(seen)
        late = 4 * GRAVITY * self.fall / (e**2 * self.height)
        return seen.reading(second / first if first > 0 else 0.0, e**2, late, 1.0)


@dataclass(frozen=True)
class ElasticChain(Law, phenomenon="impact", quantity="speed of the last ball", unit="m/s"):
    """A ball hits a row of three equal ones, all elastic and without friction: the last one goes on
    with its speed, the others rest (Mariotte; Newton's cradle). The balls stand 1 cm apart, so that
    the impacts come one after the other. Tolerance: what gravity changes within one step, g dt: an
    impact is solved at once, whatever the step."""

    speed: float = 2.0
    seconds: float = 0.3

    def build(self) -> Scene:
        row = [Pose.at(k * (2 * RADIUS + 0.01), 0.0, RADIUS) for k in range(4)]
        one, *others = (
            Sphere(f"ball_{k}", RADIUS, place, 1.0, 0.0, restitution=1.0)
            for k, place in enumerate(row)
        )
        balls = (replace(one, linear_velocity=(self.speed, 0.0, 0.0)), *others)
        return Scene(self.name, balls, ground_friction=0.0, ground_restitution=1.0)

    def read(self, seen: Watched) -> Reading:
        return seen.reading(seen.bodies[-1, -1, 7], self.speed, GRAVITY, self.speed)


@dataclass(frozen=True)
class ObliqueBounceSlip(
    Law, phenomenon="impact", quantity="level speed after the bounce", unit="m/s"
):
    """A ball that hits the ground aslant, without spin, slips all the time when mu is small: its
    level speed loses mu (1 + e) v (Routh, Rigid Dynamics; Coulomb's law for impulses). Tolerance:
    the impact is late by one step, mu (1 + e) g dt."""

    friction: float = 0.2
    restitution: float = 0.5
    level: float = 4.0
    height: float = 0.2

    def build(self) -> Scene:
        level = (self.level, 0.0, 0.0)
        return let_go(self, self.height, self.restitution, self.friction, linear_velocity=level)

    @property
    def exact(self) -> float:
        """Level speed after the bounce [m/s]."""
        down = math.sqrt(2 * GRAVITY * self.height)
        return self.level - min(self.friction * (1 + self.restitution) * down, 2 / 7 * self.level)

    def measure(self, world: World) -> Reading:
        fall = math.sqrt(2 * self.height / GRAVITY)
        seen = watch(world, fall * (1 + self.restitution))
        share = self.friction * (1 + self.restitution)
        return seen.reading(seen.bodies[-1, 0, 7], self.exact, share * GRAVITY, self.level)


@dataclass(frozen=True)
class ObliqueBounceStick(ObliqueBounceSlip):
    """Where mu is large it sticks, and leaves rolling: 5/7 of its level speed is left, whatever mu
    and e. Tolerance as of `ObliqueBounceSlip`."""

    friction: float = 0.8
    level: float = 2.0
