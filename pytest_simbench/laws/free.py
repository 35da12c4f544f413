"""Laws of free motion: nothing touches anything."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from pytest_simbench.client.world import World
from pytest_simbench.laws.base import GRAVITY, LONG, Law, Reading, Watched, rounding, watch
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
        turned = _rotation(row[3:7]) * Rotation.from_rotvec([0.0, 0.0, -self.spin * t])
        off = math.hypot(float(np.linalg.norm(row[:3] - place)), float(turned.magnitude()))
        allowed = (GRAVITY * t + self.spin) * seen.dt + rounding(5.0, seen.steps)
        return Reading(off, 0.0, allowed)


@dataclass(frozen=True)
class Spin(Law):
    """A body that nobody touches keeps spinning about a principal axis: w is constant (Euler).
    Tolerance: rounding, for every consistent method keeps a constant."""

    name = "spin"
    phenomenon = FREE
    quantity: ClassVar[str] = "angular velocity"
    unit: ClassVar[str] = "rad/s"

    spin: float = 5.0
    seconds: float = 1.0

    def build(self) -> Scene:
        body = Box(
            "body",
            (0.1, 0.2, 0.3),
            Pose.at(0.0, 0.0, 2.0),
            1.0,
            angular_velocity=(0.0, 0.0, self.spin),
        )
        return Scene(self.name, (body,), gravity=WEIGHTLESS)

    def measure(self, world: World) -> Reading:
        seen = watch(world, self.seconds)
        return Reading(
            float(seen.bodies[-1, 0, 12]), self.spin, rounding(2 * self.spin, seen.steps)
        )


@dataclass(frozen=True)
class FreeTop(Law):
    """A symmetric body turns about its own axis while the axis turns about the constant angular
    momentum L, at |L| / I1 (Landau, Lifshitz, Mechanics, section 33): the angle between its
    attitude and that after t is 0. Tolerance: its angular velocity w is late by one step all the
    time, |dw/dt| t dt, and the turn by one, |w| dt."""

    name = "free_top"
    phenomenon = FREE
    quantity: ClassVar[str] = "angle from the attitude"
    unit: ClassVar[str] = "rad"

    size: Vector3 = (0.1, 0.1, 0.4)
    omega: Vector3 = (2.0, 0.0, 6.0)
    seconds: float = 1.0

    def build(self) -> Scene:
        body = Box("body", self.size, Pose.at(0.0, 0.0, 2.0), 1.0, angular_velocity=self.omega)
        return Scene(self.name, (body,), gravity=WEIGHTLESS)

    def attitude(self, t: float) -> Rotation:
        """After a time [s]."""
        moments = self.build().bodies[0].inertia()
        momentum = moments * self.omega
        axial = self.omega[2] * (1 - moments[2] / moments[0])
        turn = Rotation.from_rotvec(momentum / moments[0] * t)
        return turn * Rotation.from_rotvec([0.0, 0.0, axial * t])

    def measure(self, world: World) -> Reading:
        seen = watch(world, self.seconds)
        t = float(seen.t[-1])
        off = (_rotation(seen.bodies[-1, 0, 3:7]) * self.attitude(t).inv()).magnitude()
        moments = self.build().bodies[0].inertia()
        momentum = moments * self.omega
        change = float(np.linalg.norm(np.cross(momentum / moments[0], self.omega)))
        allowed = (change * t + float(np.linalg.norm(self.omega))) * seen.dt
        return Reading(float(off), 0.0, allowed + rounding(1.0, seen.steps))


class _Tumble(Law):
    """A body that turns about its middle principal axis, almost: it turns over again and again
    (Dzhanibekov; Poinsot 1834)."""

    phenomenon = FREE

    size: ClassVar[Vector3] = (0.3, 0.2, 0.05)
    omega: ClassVar[Vector3] = (0.05, 6.0, 0.05)

    seconds: float

    def build(self) -> Scene:
        body = Box("body", self.size, Pose.at(0.0, 0.0, 2.0), 1.0, angular_velocity=self.omega)
        return Scene(self.name, (body,), gravity=WEIGHTLESS)

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

        times = np.linspace(0.0, seconds, 400)
        found = solve_ivp(
            lambda _, w: change(w), (0.0, seconds), self.omega, "DOP853", times,
            rtol=1e-10, atol=1e-12,
        ).y.T  # fmt: skip
        second = [(np.cross(i * change(w), w) + np.cross(i * w, change(w))) / i for w in found]
        return found, np.array(second)

    def late(self, dt: float, seconds: float) -> float:
        """By what share of itself the angular velocity may be off: the step times the sum of its
        second derivative."""
        omega, second = self.fastest(seconds)
        total = float(np.linalg.norm(second, axis=1).mean()) * seconds
        return dt * total / float(np.linalg.norm(omega, axis=1).mean())


@dataclass(frozen=True)
class TumbleEnergy(_Tumble):
    """A body that turns over keeps its rotational energy, w I w / 2, wherever it stands. Tolerance:
    twice what the angular velocity is off by, as a share: the step times the sum of |d2w/dt2|."""

    name = "tumble_energy"
    quantity: ClassVar[str] = "change of the energy"
    unit: ClassVar[str] = "%"

    seconds: float = 4.0

    def measure(self, world: World) -> Reading:
        seen = watch(world, self.seconds)
        rows = seen.bodies[:, 0]
        omega = _rotation(rows[:, 3:7]).inv().apply(rows[:, 10:])
        start = float(self.inertia @ np.square(self.omega)) / 2
        worst = float(np.abs(np.square(omega) @ self.inertia / 2 / start - 1).max())
        allowed = 2 * self.late(seen.dt, self.seconds) + rounding(2.0, seen.steps)
        return Reading(100 * worst, 0.0, 100 * allowed)


@dataclass(frozen=True)
class TumbleMomentum(_Tumble):
    """It keeps its angular momentum L too, in size and direction. Tolerance: as a share of |L|,
    what the angular velocity is off by, and the turn within one step, |w| dt."""

    name = "tumble_momentum"
    quantity: ClassVar[str] = "change of the angular momentum"
    unit: ClassVar[str] = "%"

    seconds: float = 4.0

    def measure(self, world: World) -> Reading:
        seen = watch(world, self.seconds)
        start = self.inertia * self.omega
        rows = seen.bodies[:, 0]
        turn = _rotation(rows[:, 3:7])
        now = turn.apply(self.inertia * turn.inv().apply(rows[:, 10:]))
        worst = float(np.linalg.norm(now - start, axis=1).max() / np.linalg.norm(start))
        fastest = float(np.linalg.norm(self.omega))
        allowed = self.late(seen.dt, self.seconds) + fastest * seen.dt + rounding(2.0, seen.steps)
        return Reading(100 * worst, 0.0, 100 * allowed)


class _TumbleDrift(_Tumble):
    """The same for a minute, three times slower: 6 turns over. A first-order method adds to energy
    and momentum in each step, and does not take it back: at 6 rad/s it may lose all that there is
    in a minute, at any usual step, and nothing could be asked of it."""

    omega: ClassVar[Vector3] = (2 / 120, 2.0, 2 / 120)
    study_timeout: ClassVar[float] = LONG

    def rates(self) -> tuple[FloatArray, FloatArray]:
        """Angular velocity and acceleration in the body's frame, exactly, at even times, (n, 3)."""
        omega, _ = self.fastest(self.seconds)
        i = self.inertia
        return omega, np.asarray(np.cross(i * omega, omega) / i)

    def spun(self, seen: Watched) -> FloatArray:
        """Angular velocity in the body's frame as it was seen, (n, 3)."""
        rows = seen.bodies[:, 0]
        return np.asarray(_rotation(rows[:, 3:7]).inv().apply(rows[:, 10:]))


@dataclass(frozen=True)
class TumbleEnergyDrift(_TumbleDrift):
    """A body that turns over for a minute keeps its rotational energy E = w I w / 2 (Euler's
    equations I w' = I w x w: w I w' = 0). Tolerance: explicit Euler adds w' I w' dt^2 / 2 to it in
    each step, implicit Euler takes as much away; late by one step is twice that, dt times the sum
    of w' I w' over the time, as a share of E. The protocol `smoke` takes 3 s."""

    name = "tumble_energy_drift"
    quantity: ClassVar[str] = "change of the energy"
    unit: ClassVar[str] = "%"

    seconds: float = 60.0

    def smoke(self) -> TumbleEnergyDrift:
        return replace(self, seconds=3.0)

    def measure(self, world: World) -> Reading:
        seen = watch(world, self.seconds)
        start = float(self.inertia @ np.square(self.omega)) / 2
        found = np.square(self.spun(seen)) @ self.inertia / 2
        _, rate = self.rates()
        share = float((np.square(rate) @ self.inertia).mean()) * self.seconds / start
        allowed = share * seen.dt + rounding(2.0, seen.steps)
        return Reading(100 * float(np.abs(found / start - 1).max()), 0.0, 100 * allowed)


@dataclass(frozen=True)
class TumbleMomentumDrift(_TumbleDrift):
    """It keeps the size of its angular momentum I w (Euler: I w (I w)' = 0). Tolerance: explicit
    Euler adds |I w'|^2 dt^2 to its square in each step, implicit Euler takes as much away, a half
    of that to its size; late by one step is twice that, dt times the sum of |I w'|^2 over the time,
    as a share of |I w|^2. The protocol `smoke` takes 3 s."""

    name = "tumble_momentum_drift"
    quantity: ClassVar[str] = "change of the angular momentum's size"
    unit: ClassVar[str] = "%"

    seconds: float = 60.0

    def smoke(self) -> TumbleMomentumDrift:
        return replace(self, seconds=3.0)

    def measure(self, world: World) -> Reading:
        seen = watch(world, self.seconds)
        start = float(np.linalg.norm(self.inertia * self.omega))
        found = np.linalg.norm(self.inertia * self.spun(seen), axis=1)
        _, rate = self.rates()
        share = float(np.square(self.inertia * rate).sum(axis=1).mean()) * self.seconds / start**2
        allowed = share * seen.dt + rounding(2.0, seen.steps)
        return Reading(100 * float(np.abs(found / start - 1).max()), 0.0, 100 * allowed)


def _rotation(quaternion: FloatArray) -> Rotation:
    """Of w, x, y, z, (4,) or (n, 4)."""
    return Rotation.from_quat(np.roll(quaternion, -1, axis=-1))
