"""Laws of joints that move freely, pendulums and sliders."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin
from scipy.special import ellipk

from pytest_simbench.laws.base import GRAVITY, LONG, Law, Reading, Watched, solved
from pytest_simbench.laws.mechanisms import MOUNT, Part, Y, mechanism
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.scene import STANDARD_GRAVITY, FloatArray, Robot, Scene, Vector3


class Passive(Law, name="", phenomenon="joints"):
    """A mechanism without drives that falls under gravity."""

    gravity: ClassVar[Vector3] = STANDARD_GRAVITY

    def parts(self) -> tuple[Part, ...]:
        raise NotImplementedError

    @property
    def mechanism(self) -> Robot:
        """The parts, as they are let go."""
        return mechanism(self.name, *self.parts())

    def build(self) -> Scene:
        return Scene(self.name, robot=self.mechanism, gravity=self.gravity)

    @property
    def model(self) -> Any:  # Pinocchio has no types
        """The same for Pinocchio, with gravity."""
        found = RobotModel(self.mechanism).pin
        found.gravity.linear = np.array(self.gravity)
        return found

    def exact(self, seconds: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """What `passive_motion` says of it."""
        return passive_motion(self.model, self.mechanism.column("initial_position"), seconds)


def passive_motion(
    model: Any, start: FloatArray, seconds: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Joint positions, velocities and accelerations of the equations of motion M(q) q'' + h(q, q')
    = 0 of a model of Pinocchio's, by its articulated-body algorithm and DOP853 with a relative
    tolerance of 1e-10, (n, n_joints) each."""
    data, n = model.createData(), len(start)

    def change(_: float, state: FloatArray) -> FloatArray:
        q, v = state[:n], state[n:]
        return np.concatenate([v, pin.aba(model, data, q, v, np.zeros(n))])

    found = solved(change, [*start, *np.zeros(n)], seconds, 200)
    bent = np.array([change(0.0, state)[n:] for state in found])
    return found[:, :n], found[:, n:], bent


class JointMotion(
    Passive, name="", quantity="largest distance of a joint from its place", unit="rad or m"
):
    """Where the joints are after a time, by the equations of motion."""

    def read(self, seen: Watched) -> Reading:
        t = seen.end
        q, v, a = self.exact(t)
        off = float(np.abs(seen.joints[-1, 0] - q[-1]).max())
        late = float(np.abs(v).max()) + float(np.abs(a).max(axis=1).mean()) * t
        return seen.reading(off, 0.0, late, float(np.abs(q).max()))


class _Energy(Passive, quantity="largest change of the energy", unit="J"):
    """The energy stays what it was."""

    def read(self, seen: Watched) -> Reading:
        model, (q, v) = self.model, seen.joints.swapaxes(0, 1)
        data, rows = model.createData(), [self.mechanism.column("initial_position"), *q]
        kinetic = [pin.computeKineticEnergy(model, data, *row) for row in zip(q, v, strict=True)]
        before, *potential = (pin.computePotentialEnergy(model, data, row) for row in rows)
        off = float(np.abs(np.add(kinetic, potential) - before).max())
        scale = float(np.ptp(potential))
        late = self.late(np.gradient(potential, seen.dt))
        return seen.reading(off, 0.0, late, scale)

    def late(self, power: FloatArray) -> float:
        """By what the energy may be off for each second of a step [W], from the power of gravity at
        each sample, (n,)."""
        return float(np.abs(power).max())


def _period(part: Part) -> float:
    """Of a part that hangs from its hinge and is let go, see `PendulumPeriod` [s]."""
    length = -part.centre[2]
    about_hinge = part.mass * length**2 + part.inertia[1]
    slow = math.sqrt(about_hinge / (part.mass * GRAVITY * length))
    return 4 * slow * float(ellipk(math.sin(part.start / 2) ** 2))


def _seen_period(seen: Watched, joint: int) -> float:
    """Between the first two passes of a joint; the whole time where there are none [s]."""
    found = seen.crossings(seen.joints[:, 0, joint])
    return float(found[1] - found[0]) if len(found) > 1 else seen.end


@dataclass(frozen=True)
class PendulumPeriod(Passive, quantity="period", unit="s"):
    """A pendulum that is let go at the angle a swings with the period T = 4 sqrt(I / m g l)
    K(sin^2(a / 2)), K the complete elliptic integral of the first kind (Landau, Lifshitz,
    Mechanics, section 11). Tolerance: late by one step, at each end of the period."""

    length: float = 0.5
    angle: float = 2.0
    seconds: float = 3.5

    def parts(self) -> tuple[Part, ...]:
        return (Part("swing", Y, centre=(0.0, 0.0, -self.length), start=self.angle),)

    def read(self, seen: Watched) -> Reading:
        return Reading(_seen_period(seen, 0), _period(*self.parts()), 2 * seen.dt)


@dataclass(frozen=True)
class CompoundPendulum(PendulumPeriod):
    """A heavy body on a hinge: its moment of inertia about its centre counts (Huygens, Steiner):
    I = m l^2 + I_c. Tolerance as of `PendulumPeriod`."""

    length: float = 0.2
    angle: float = 0.5
    seconds: float = 3.2
    inertia: float = 0.05

    def parts(self) -> tuple[Part, ...]:
        return (replace(*super().parts(), inertia=(self.inertia,) * 3),)


@dataclass(frozen=True)
class TwoPendulums(Passive, quantity="larger error of the two periods", unit="s"):
    """Two pendulums that hang on one fixed mount do not know of each other (Newton: what cannot
    move transmits no motion): each swings with its own period, that of `PendulumPeriod`, whatever
    the other's length, mass and swing. Tolerance as there."""

    lengths: tuple[float, float] = (0.5, 0.2)
    angles: tuple[float, float] = (1.0, -1.5)
    masses: tuple[float, float] = (1.0, 5.0)
    apart: float = 1.5
    seconds: float = 3.6

    def parts(self) -> tuple[Part, ...]:
        pairs = zip(self.lengths, self.masses, self.angles, strict=True)
        return tuple(
            Part(
                f"swing {k}", Y, (0.0, k * self.apart, 0.0), (0.0, 0.0, -length), mass,
                start=angle, on=MOUNT,
            )
            for k, (length, mass, angle) in enumerate(pairs)
        )  # fmt: skip

    def read(self, seen: Watched) -> Reading:
        parts = enumerate(self.parts())
        errors = [abs(_seen_period(seen, k) - _period(part)) for k, part in parts]
        return Reading(max(errors), 0.0, 2 * seen.dt)


SWING = Part("swing", Y, centre=(0.0, 0.0, -0.1), start=1.5)


@dataclass(frozen=True)
class PendulumEnergy(_Energy):
    """The energy of a pendulum that swings by 1.5 rad stays what it was. Tolerance: the potential
    energy is late by one step against the kinetic one, P dt with P the largest power; a symplectic
    method of the first order is off by half of that, and does not drift (Hairer, Lubich, Wanner,
    Geometric Numerical Integration, IX.8)."""

    seconds: float = 6.0

    def parts(self) -> tuple[Part, ...]:
        return (SWING,)


@dataclass(frozen=True)
class PendulumEnergyDrift(PendulumEnergy, study_timeout=LONG):
    """Over 100 periods the energy of that pendulum stays what it was, too. Tolerance as of
    `PendulumEnergy`, whatever the number of periods: what a symplectic method is off by swings with
    the pendulum and does not add up. Only rounding does. The protocol `smoke` takes 4 periods."""

    seconds: float = 100 * _period(SWING)

    def smoke(self) -> PendulumEnergyDrift:
        return replace(self, seconds=self.seconds / 25)


@dataclass(frozen=True)
class DoublePendulum(JointMotion):
    """Two pendulums, one hung on the other (Lagrange), against the equations of motion. Tolerance:
    late by one step, and a velocity that is late by one step all the time: |v| dt + |a| t dt."""

    seconds: float = 1.0

    def parts(self) -> tuple[Part, ...]:
        one = Part("one", Y, centre=(0.0, 0.0, -0.5), start=1.0)
        two = Part("two", Y, (0.0, 0.0, -0.5), centre=(0.0, 0.0, -0.5), start=0.5)
        return one, two


@dataclass(frozen=True)
class DoublePendulumEnergy(_Energy):
    """The energy of a double pendulum stays what it was. Tolerance: the power is late by one step
    all the time, the step times the sum of its changes. Its mass matrix changes with its position,
    so that semi-implicit Euler is not symplectic, and the bound of `PendulumEnergy` does not
    hold."""

    seconds: float = 2.0

    def parts(self) -> tuple[Part, ...]:
        return DoublePendulum().parts()

    def late(self, power: FloatArray) -> float:
        return float(np.abs(np.diff(power)).sum())


@dataclass(frozen=True)
class SwingingSlider(JointMotion):
    """A mass slides without friction along a rod that swings: Coriolis force, centrifugal force and
    gravity, r'' = r q'^2 + g cos q, (I + m r^2) q'' = -m g r sin q - 2 m r r' q'. Tolerance as of
    `DoublePendulum`."""

    seconds: float = 0.6

    def parts(self) -> tuple[Part, ...]:
        rod = Part("rod", Y, inertia=(0.2, 0.2, 0.2), start=1.2)
        return rod, Part("bead", (0.0, 0.0, -1.0), start=0.3, slides=True)


@dataclass(frozen=True)
class SphericalPendulum(JointMotion, gravity=(3.0, 4.0, -8.0)):
    """A bob on two crossed hinges that moves out of their planes: gyroscopic terms of three
    dimensions, against the equations of motion. Tolerance as of `DoublePendulum`."""

    seconds: float = 1.0

    def parts(self) -> tuple[Part, ...]:
        bob = Part("across", Y, centre=(0.0, 0.1, -0.5), start=0.3, inertia=(0.02, 0.04, 0.03))
        return Part("along", (1.0, 0.0, 0.0), start=0.8), bob
