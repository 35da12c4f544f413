"""Laws of drives: what a joint does that is told where to be."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from scipy.optimize import brentq

from pytest_simbench.laws.base import GRAVITY, Law, Reading, Watched, held, stillness
from pytest_simbench.laws.mechanisms import STRONG, Part, mechanism
from pytest_simbench.scene import Scene, Trajectory


class _Driven(Law, phenomenon="joints", quantity="angle", unit="rad"):
    """A wheel of 0.5 kg m^2 on a vertical axis, and its drive."""

    inertia: ClassVar[float] = 0.5
    goal: ClassVar[float] = 0.0

    def commands(self) -> Trajectory:
        return held(self.goal, self.seconds)

    def wheel(
        self, stiffness: float, damping: float, start: float = 0.0, effort: float = STRONG
    ) -> Scene:
        """Its drive's stiffness [N m/rad], damping [N m s/rad] and effort limit [N m]."""
        part = Part(
            "wheel", (0.0, 0.0, 1.0), inertia=(self.inertia,) * 3, start=start,
            stiffness=stiffness, damping=damping, effort=effort,
        )  # fmt: skip
        return Scene(self.name, robot=mechanism(self.name, part))


@dataclass(frozen=True)
class StepResponse(_Driven):
    """A critically damped drive that is told to go from x0 to 0 is at x0 (1 + w t) exp(-w t), with
    w^2 = k / I. Tolerance: |v| dt + |a| t dt at the largest, x0 w / e and x0 w^2."""

    rate: float = 10.0
    start: float = 0.5
    seconds: float = 0.1

    def build(self) -> Scene:
        k, d = self.inertia * self.rate**2, 2 * self.inertia * self.rate
        return self.wheel(k, d, self.start)

    def read(self, seen: Watched) -> Reading:
        t = seen.end
        x = self.rate * t
        exact = self.start * (1 + x) * math.exp(-x)
        late = self.start * self.rate * (1 / math.e + x)
        return seen.reading(seen.joints[-1, 0, 0], exact, late, self.start)


@dataclass(frozen=True)
class SpringDamper(_Driven):
    """A weakly damped one swings: x0 exp(-z w t) (cos(u t) + z w / u sin(u t)), u = w sqrt(1 -
    z^2). Tolerance as of `StepResponse`, with |v| up to x0 w."""

    rate: float = 10.0
    damping: float = 0.1
    start: float = 0.5
    seconds: float = 0.6

    def build(self) -> Scene:
        d = 2 * self.damping * self.inertia * self.rate
        return self.wheel(self.inertia * self.rate**2, d, self.start)

    def read(self, seen: Watched) -> Reading:
        t, w, z = seen.end, self.rate, self.damping
        u = w * math.sqrt(1 - z * z)
        exact = self.start * math.exp(-z * w * t)
        exact *= math.cos(u * t) + z * w / u * math.sin(u * t)
        return seen.reading(seen.joints[-1, 0, 0], exact, self.start * w * (1 + w * t), self.start)


@dataclass(frozen=True)
class EffortLimit(_Driven, goal=5.0):
    """A drive told to go far away pushes with its limit and no more: x = (F / I) t^2 / 2.
    Tolerance: (F / I) t dt."""

    effort: float = 2.0
    seconds: float = 0.5

    def build(self) -> Scene:
        return self.wheel(2000.0, 20.0, effort=self.effort)

    def read(self, seen: Watched) -> Reading:
        t, pull = seen.end, self.effort / self.inertia
        return seen.reading(seen.joints[-1, 0, 0], pull * t * t / 2, pull * t, 1.0)


@dataclass(frozen=True)
class Tracking(_Driven):
    """A drive that is told position and velocity of a steady turn follows it: x = v t (1 - exp(-w
    t)) from rest, critically damped. Tolerance: late by one step, and a set point of the end of
    each step holds from its beginning on: 2 v dt."""

    speed: float = 1.0
    rate: float = 10.0
    seconds: float = 1.0

    def build(self) -> Scene:
        return self.wheel(self.inertia * self.rate**2, 2 * self.inertia * self.rate)

    def commands(self) -> Trajectory:
        return held(self.speed * self.seconds, self.seconds, self.speed)

    def read(self, seen: Watched) -> Reading:
        t = seen.end
        exact = self.speed * t * (1 - math.exp(-self.rate * t))
        return seen.reading(seen.joints[-1, 0, 0], exact, 2 * self.speed, 1.0)


@dataclass(frozen=True)
class Sag(Law, phenomenon="joints", quantity="angle", unit="rad"):
    """A level rod on a spring sags until k x = m g l cos x. Tolerance: what gravity turns it by
    within one step, (g / l) dt^2, and rounding."""

    stiffness: float = 50.0
    seconds: float = 2.0

    def build(self) -> Scene:
        part = Part(
            "rod", (0.0, 1.0, 0.0), centre=(1.0, 0.0, 0.0), stiffness=self.stiffness,
            damping=2 * math.sqrt(self.stiffness), effort=STRONG,
        )  # fmt: skip
        return Scene(self.name, robot=mechanism(self.name, part))

    def read(self, seen: Watched) -> Reading:
        exact = brentq(lambda x: self.stiffness * x - GRAVITY * math.cos(x), 0.0, 1.5)
        allowed = stillness(seen.dt, 1.0)
        return Reading(float(seen.joints[-1, 0, 0]), float(exact), allowed)


@dataclass(frozen=True)
class FeedForward(Sag):
    """The same rod is told the torque that gravity asks for, m g l: it stays level. Tolerance as
    of `Sag`."""

    seconds: float = 1.0

    def commands(self) -> Trajectory:
        return held(0.0, self.seconds, effort=-GRAVITY)

    def read(self, seen: Watched) -> Reading:
        return Reading(float(seen.joints[-1, 0, 0]), 0.0, stillness(seen.dt, 1.0))
