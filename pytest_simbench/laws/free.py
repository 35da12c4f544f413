"""Laws of free motion: nothing touches anything, but for forces that act for a time."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
from scipy.spatial.transform import Rotation

from pytest_simbench.laws.base import GRAVITY, LONG, Law, Reading, Watched, solved
from pytest_simbench.scene import (
    STANDARD_GRAVITY,
    Box,
    Cylinder,
    FloatArray,
    Pose,
    Scene,
    Vector3,
    Wrench,
)

FREE = "free motion"
OPEN: Vector3 = (1e3, 1e3, 1e3)
"""A room without walls [m]."""

WEIGHTLESS: Vector3 = (0.0, 0.0, 0.0)


def alone(
    law: Law, size: Vector3, height: float, gravity: Vector3 = STANDARD_GRAVITY, **values: Any
) -> Scene:
    """A box of 1 kg, so high above the ground [m] that it does not reach it."""
    body = Box("body", size, Pose.at(0.0, 0.0, height), 1.0, **values)
    return Scene(law.name, (body,), gravity=gravity)


@dataclass(frozen=True)
class FreeFall(Law, phenomenon=FREE, quantity="height fallen", unit="m"):
    """A body that is let go falls s = g t^2 / 2 (Galilei). Tolerance: its speed is late by one step
    all the time, g t dt; semi-implicit Euler's is g t dt / 2."""

    seconds: float = 1.0

    def build(self) -> Scene:
        return alone(self, (0.1,) * 3, 8.0)

    def read(self, seen: Watched) -> Reading:
        t = seen.end
        fallen = 8.0 - float(seen.bodies[-1, 0, 2])
        return seen.reading(fallen, GRAVITY * t * t / 2, GRAVITY * t, 8.0)


@dataclass(frozen=True)
class FallSpeed(FreeFall, quantity="speed of the fall", unit="m/s"):
    """It then has the speed v = g t: nothing damps it. Tolerance: late by one step, g dt."""

    def read(self, seen: Watched) -> Reading:
        t = seen.end
        return seen.reading(-float(seen.bodies[-1, 0, 9]), GRAVITY * t, GRAVITY, GRAVITY * t)


@dataclass(frozen=True)
class DampedFall(FreeFall, quantity="speed of the fall", unit="m/s"):
    """A body that is damped by c v / m falls ever less fast, v = (g / c) (1 - exp(-c t)), towards
    its terminal speed g / c (Stokes' law of resistance). Tolerance: late by one step, g dt."""

    damping: float = 2.0

    def build(self) -> Scene:
        return alone(self, (0.1,) * 3, 8.0, linear_damping=self.damping)

    def read(self, seen: Watched) -> Reading:
        exact = GRAVITY / self.damping * -math.expm1(-self.damping * seen.end)
        return seen.reading(-float(seen.bodies[-1, 0, 9]), exact, GRAVITY, exact)


@dataclass(frozen=True)
class ObliqueGravity(Law, phenomenon=FREE, quantity="distance from the place", unit="m"):
    """Gravity has three components: after t a body has moved by g t^2 / 2 in each; the distance
    between where it is and where it should be is 0. Tolerance as of `FreeFall`."""

    gravity: Vector3 = (1.0, -2.0, -4.0)
    seconds: float = 1.0

    def build(self) -> Scene:
        return alone(self, (0.1,) * 3, 8.0, self.gravity)

    def read(self, seen: Watched) -> Reading:
        t = seen.end
        place = np.array([0.0, 0.0, 8.0]) + np.array(self.gravity) * t * t / 2
        off = float(np.linalg.norm(seen.bodies[-1, 0, :3] - place))
        pull = float(np.linalg.norm(self.gravity))
        return seen.reading(off, 0.0, pull * t, 8.0)


@dataclass(frozen=True)
class Projectile(Law, phenomenon=FREE, quantity="distance from the place, turn included", unit="m"):
    """A thrown body flies p0 + v t + g t^2 / 2 and turns about a principal axis by w t: where it is
    after 1 s, in all six components (an angle counts as the way of a point 1 m from the axis).
    Tolerance as of `FreeFall`, and the turn late by one step, w dt."""

    velocity: Vector3 = (2.0, -1.5, 4.0)
    spin: float = 3.0
    seconds: float = 1.0

    def build(self) -> Scene:
        start = {"linear_velocity": self.velocity, "angular_velocity": (0.0, 0.0, self.spin)}
        return alone(self, (0.3, 0.2, 0.1), 2.0, **start)

    def read(self, seen: Watched) -> Reading:
        t, row = seen.end, seen.bodies[-1, 0]
        place = np.array([0.0, 0.0, 2.0]) + np.array(self.velocity) * t
        place[2] -= GRAVITY * t * t / 2
        turned = rotation_of(row[3:7]) * Rotation.from_rotvec([0.0, 0.0, -self.spin * t])
        off = math.hypot(float(np.linalg.norm(row[:3] - place)), float(turned.magnitude()))
        return seen.reading(off, 0.0, (GRAVITY * t + self.spin), 5.0)


def rotation_of(quaternion: FloatArray) -> Rotation:
    """Of quaternions w, x, y, z, (4,) or (n, 4)."""
    return Rotation.from_quat(np.roll(quaternion, -1, axis=-1))


@dataclass(frozen=True)
class Spin(Law, phenomenon=FREE, quantity="angular velocity", unit="rad/s"):
    """A body that nobody touches keeps spinning about a principal axis: w is constant (Euler).
    Tolerance: rounding, for every consistent method keeps a constant."""

    spin: float = 5.0
    seconds: float = 1.0

    def build(self) -> Scene:
        omega = (0.0, 0.0, self.spin)
        return alone(self, (0.1, 0.2, 0.3), 2.0, WEIGHTLESS, angular_velocity=omega)

    def read(self, seen: Watched) -> Reading:
        return seen.reading(seen.bodies[-1, 0, 12], self.spin, 0.0, 2 * self.spin)


@dataclass(frozen=True)
class FreeTop(Law, phenomenon=FREE, quantity="angle from the attitude", unit="rad"):
    """A symmetric body turns about its own axis while the axis turns about the constant angular
    momentum L, at |L| / I1 (Landau, Lifshitz, Mechanics, section 33): the angle between its
    attitude and that after t is 0. Tolerance: its angular velocity w is late by one step all the
    time, |dw/dt| t dt, and the turn by one, |w| dt."""

    size: Vector3 = (0.1, 0.1, 0.4)
    omega: Vector3 = (2.0, 0.0, 6.0)
    seconds: float = 1.0

    def build(self) -> Scene:
        return alone(self, self.size, 2.0, WEIGHTLESS, angular_velocity=self.omega)

    def attitude(self, t: float) -> Rotation:
        """After a time [s]."""
        moments = self.build().bodies[0].inertia()
        momentum = moments * self.omega
        axial = self.omega[2] * (1 - moments[2] / moments[0])
        turn = Rotation.from_rotvec(momentum / moments[0] * t)
        return turn * Rotation.from_rotvec([0.0, 0.0, axial * t])

    def read(self, seen: Watched) -> Reading:
        t = seen.end
        off = (rotation_of(seen.bodies[-1, 0, 3:7]) * self.attitude(t).inv()).magnitude()
        moments = self.build().bodies[0].inertia()
        momentum = moments * self.omega
        change = float(np.linalg.norm(np.cross(momentum / moments[0], self.omega)))
        return seen.reading(float(off), 0.0, change * t + float(np.linalg.norm(self.omega)), 1.0)


@dataclass(frozen=True)
class FreeCylinder(FreeTop):
    """The same for a cylinder (I1 = m (3 r^2 + l^2) / 12, I3 = m r^2 / 2).
    Tolerance as of `FreeTop`."""

    def build(self) -> Scene:
        body = Cylinder("rod", 0.05, 0.4, Pose.at(0.0, 0.0, 2.0), 1.0, angular_velocity=self.omega)
        return Scene(self.name, (body,), gravity=WEIGHTLESS)


class _Tumble(Law, phenomenon=FREE):
    """A body that turns about its middle principal axis, almost: it turns over again and again
    (Dzhanibekov; Poinsot 1834)."""

    size: ClassVar[Vector3] = (0.3, 0.2, 0.05)
    omega: ClassVar[Vector3] = (0.05, 6.0, 0.05)

    def build(self) -> Scene:
        return alone(self, self.size, 2.0, WEIGHTLESS, angular_velocity=self.omega)

    @property
    def inertia(self) -> FloatArray:
        """Principal moments [kg m^2], (3,)."""
        return self.build().bodies[0].inertia()

    def fastest(self, seconds: float) -> tuple[FloatArray, FloatArray]:
        """Angular velocity in the body's frame [rad/s] and its second derivative, exactly, (n, 3)
        each."""
        i = self.inertia

        def change(omega: FloatArray) -> FloatArray:
            return np.asarray(np.cross(i * omega, omega) / i)

        found = solved(lambda _, w: change(w), self.omega, seconds, 400)
        second = [(np.cross(i * change(w), w) + np.cross(i * w, change(w))) / i for w in found]
        return found, np.array(second)

    def late(self, seconds: float) -> float:
        """By what share of itself the angular velocity may be off for each second of a step: the
        sum of its second derivative."""
        omega, second = self.fastest(seconds)
        total = float(np.linalg.norm(second, axis=1).mean()) * seconds
        return total / float(np.linalg.norm(omega, axis=1).mean())

    def spun(self, seen: Watched) -> FloatArray:
        """Angular velocity in the body's frame as it was seen, (n, 3)."""
        rows = seen.bodies[:, 0]
        return np.asarray(rotation_of(rows[:, 3:7]).inv().apply(rows[:, 10:]))

    def energy(self, seen: Watched) -> float:
        """By what share of itself the rotational energy is off at most."""
        start = self.inertia @ np.square(self.omega)
        return float(np.abs(np.square(self.spun(seen)) @ self.inertia / start - 1).max())


@dataclass(frozen=True)
class TumbleEnergy(_Tumble, quantity="change of the energy", unit="%"):
    """A body that turns over keeps its rotational energy, w I w / 2, wherever it stands. Tolerance:
    twice what the angular velocity is off by, as a share: the step times the sum of |d2w/dt2|."""

    seconds: float = 4.0

    def read(self, seen: Watched) -> Reading:
        return seen.reading(100 * self.energy(seen), 0.0, 200 * self.late(self.seconds), 200.0)


@dataclass(frozen=True)
class TumbleMomentum(_Tumble, quantity="change of the angular momentum", unit="%"):
    """It keeps its angular momentum L too, in size and direction. Tolerance: as a share of |L|,
    what the angular velocity is off by, and the turn within one step, |w| dt."""

    seconds: float = 4.0

    def read(self, seen: Watched) -> Reading:
        start = self.inertia * self.omega
        now = rotation_of(seen.bodies[:, 0, 3:7]).apply(self.inertia * self.spun(seen))
        worst = float(np.linalg.norm(now - start, axis=1).max() / np.linalg.norm(start))
        late = self.late(self.seconds) + float(np.linalg.norm(self.omega))
        return seen.reading(100 * worst, 0.0, 100 * late, 200.0)


@dataclass(frozen=True)
class _TumbleDrift(_Tumble, omega=(2 / 120, 2.0, 2 / 120), study_timeout=LONG):
    """The same for a minute, three times slower: 6 turns over. A first-order method adds to energy
    and momentum in each step, and does not take it back: at 6 rad/s it may lose all that there is
    in a minute, at any usual step, and nothing could be asked of it."""

    seconds: float = 60.0

    def smoke(self) -> Self:
        return replace(self, seconds=3.0)

    def rates(self) -> FloatArray:
        """Angular acceleration in the body's frame, exactly, at even times, (n, 3)."""
        omega, _ = self.fastest(self.seconds)
        return np.asarray(np.cross(self.inertia * omega, omega) / self.inertia)


@dataclass(frozen=True)
class TumbleEnergyDrift(_TumbleDrift, quantity="change of the energy", unit="%"):
    """A body that turns over for a minute keeps its rotational energy E = w I w / 2 (Euler's
    equations I w' = I w x w: w I w' = 0). Tolerance: explicit Euler adds w' I w' dt^2 / 2 to it in
    each step, implicit Euler takes as much away; late by one step is twice that, dt times the sum
    of w' I w' over the time, as a share of E. The protocol `smoke` takes 3 s."""

    def read(self, seen: Watched) -> Reading:
        start = float(self.inertia @ np.square(self.omega)) / 2
        share = float((np.square(self.rates()) @ self.inertia).mean()) * self.seconds / start
        return seen.reading(100 * self.energy(seen), 0.0, 100 * share, 200.0)


@dataclass(frozen=True)
class TumbleMomentumDrift(_TumbleDrift, quantity="change of the angular momentum's size", unit="%"):
    """It keeps the size of its angular momentum I w (Euler: I w (I w)' = 0). Tolerance: explicit
    Euler adds |I w'|^2 dt^2 to its square in each step, implicit Euler takes as much away, a half
    of that to its size; late by one step is twice that, dt times the sum of |I w'|^2 over the time,
    as a share of |I w|^2. The protocol `smoke` takes 3 s."""

    def read(self, seen: Watched) -> Reading:
        start = float(np.linalg.norm(self.inertia * self.omega))
        found = np.linalg.norm(self.inertia * self.spun(seen), axis=1)
        bent = np.square(self.inertia * self.rates()).sum(axis=1)
        share = float(bent.mean()) * self.seconds / start**2
        worst = float(np.abs(found / start - 1).max())
        return seen.reading(100 * worst, 0.0, 100 * share, 200.0)


RADIUS, LENGTH, MASS = 0.05, 0.3, 2.0


@dataclass(frozen=True)
class AxialForce(Law, phenomenon=FREE, quantity="speed along the axis", unit="m/s"):
    """A rod that a force pulls along its axis from t0 to t1 has v = F (t1 - t0) / m from then on
    (Newton's second law). Tolerance: late by one step, F dt / m."""

    force: float = 5.0
    start: float = 0.1
    end: float = 0.5
    seconds: float = 0.7

    def wrench(self) -> Wrench:
        return Wrench(force=(self.force, 0.0, 0.0), start=self.start, end=self.end)

    def rod(self) -> Cylinder:
        """Its axis is the world's x."""
        lying = Pose((0.0, 0.0, 2.0), (0.5**0.5, 0.0, 0.5**0.5, 0.0))
        return Cylinder("rod", RADIUS, LENGTH, lying, MASS, wrenches=(self.wrench(),))

    def build(self) -> Scene:
        return Scene(self.name, (self.rod(),), gravity=WEIGHTLESS)

    def read(self, seen: Watched) -> Reading:
        return self._reading(seen, 7, self.force / MASS)

    def _reading(self, seen: Watched, column: int, rate: float) -> Reading:
        """Of a column of the state that grows by `rate` in a second while the wrench acts."""
        exact = rate * (self.end - self.start)
        return seen.reading(seen.bodies[-1, 0, column], exact, rate, exact)


@dataclass(frozen=True)
class AxialTorque(AxialForce, quantity="angular velocity about the axis", unit="rad/s"):
    """A rod under a torque about its axis has omega = T (t1 - t0) / I with I = m r^2 / 2.
    Tolerance: late by one step, T dt / I."""

    torque: float = 0.02

    def wrench(self) -> Wrench:
        return Wrench(torque=(self.torque, 0.0, 0.0), start=self.start, end=self.end)

    def read(self, seen: Watched) -> Reading:
        return self._reading(seen, 10, self.torque / (MASS * RADIUS**2 / 2))
