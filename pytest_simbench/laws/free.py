"""Laws of free motion: nothing touches anything, but for forces that act for a time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from pytest_simbench.client.world import World
from pytest_simbench.laws.base import GRAVITY, Law, Reading, Watched, watch
from pytest_simbench.scene import Box, Cylinder, FloatArray, Pose, Scene, Vector3, Wrench

FREE = "free motion"
OPEN: Vector3 = (1e3, 1e3, 1e3)
"""A room without walls [m]."""

WEIGHTLESS: Vector3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class FreeFall(Law, name="free_fall", phenomenon=FREE, quantity="height fallen", unit="m"):
    """A body that is let go falls s = g t^2 / 2 (Galilei). Tolerance: its speed is late by one step
    all the time, g t dt; semi-implicit Euler's is g t dt / 2."""

    seconds: float = 1.0

    def build(self) -> Scene:
        return Scene(self.name, (Box("body", (0.1,) * 3, Pose.at(0.0, 0.0, 8.0), 1.0),))

    def read(self, seen: Watched) -> Reading:
        t = seen.end
        fallen = 8.0 - float(seen.bodies[-1, 0, 2])
        return seen.reading(fallen, GRAVITY * t * t / 2, GRAVITY * t, 8.0)


@dataclass(frozen=True)
class FallSpeed(FreeFall, name="fall_speed", quantity="speed of the fall", unit="m/s"):
    """It then has the speed v = g t: nothing damps it. Tolerance: late by one step, g dt."""

    def read(self, seen: Watched) -> Reading:
        t = seen.end
        return seen.reading(-float(seen.bodies[-1, 0, 9]), GRAVITY * t, GRAVITY, GRAVITY * t)


@dataclass(frozen=True)
class DampedFall(FreeFall, name="damped_fall", quantity="speed of the fall", unit="m/s"):
    """A body that is damped by c v / m falls ever less fast, v = (g / c) (1 - exp(-c t)), towards
    its terminal speed g / c (Stokes' law of resistance). Tolerance: late by one step, g dt."""

    damping: float = 2.0

    def build(self) -> Scene:
        body = Box("body", (0.1,) * 3, Pose.at(0.0, 0.0, 8.0), 1.0, linear_damping=self.damping)
        return Scene(self.name, (body,))

    def read(self, seen: Watched) -> Reading:
        exact = GRAVITY / self.damping * -math.expm1(-self.damping * seen.end)
        return seen.reading(-float(seen.bodies[-1, 0, 9]), exact, GRAVITY, exact)


@dataclass(frozen=True)
class ObliqueGravity(
    Law, name="oblique_gravity", phenomenon=FREE, quantity="distance from the place", unit="m"
):
    """Gravity has three components: after t a body has moved by g t^2 / 2 in each; the distance
    between where it is and where it should be is 0. Tolerance as of `FreeFall`."""

    gravity: Vector3 = (1.0, -2.0, -4.0)
    seconds: float = 1.0

    def build(self) -> Scene:
        body = Box("body", (0.1,) * 3, Pose.at(0.0, 0.0, 8.0), 1.0)
        return Scene(self.name, (body,), gravity=self.gravity)

    def read(self, seen: Watched) -> Reading:
        t = seen.end
        place = np.array([0.0, 0.0, 8.0]) + np.array(self.gravity) * t * t / 2
        off = float(np.linalg.norm(seen.bodies[-1, 0, :3] - place))
        pull = float(np.linalg.norm(self.gravity))
        return seen.reading(off, 0.0, pull * t, 8.0)


@dataclass(frozen=True)
class Projectile(
    Law,
    name="projectile",
    phenomenon=FREE,
    quantity="distance from the place, turn included",
    unit="m",
):
    """A thrown body flies p0 + v t + g t^2 / 2 and turns about a principal axis by w t: where it is
    after 1 s, in all six components (an angle counts as the way of a point 1 m from the axis).
    Tolerance as of `FreeFall`, and the turn late by one step, w dt."""

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


RADIUS, LENGTH, MASS = 0.05, 0.3, 2.0


@dataclass(frozen=True)
class AxialForce(
    Law, name="axial_force", phenomenon=FREE, quantity="speed along the axis", unit="m/s"
):
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

    def measure(self, world: World) -> Reading:
        return self._reading(world, 7, self.force / MASS)

    def _reading(self, world: World, column: int, rate: float) -> Reading:
        """Of a column of the state that grows by `rate` in a second while the wrench acts."""
        seen = watch(world, self.seconds)
        exact = rate * (self.end - self.start)
        return seen.reading(seen.bodies[-1, 0, column], exact, rate, exact)


@dataclass(frozen=True)
class AxialTorque(
    AxialForce, name="axial_torque", quantity="angular velocity about the axis", unit="rad/s"
):
    """A rod under a torque about its axis has omega = T (t1 - t0) / I with I = m r^2 / 2.
    Tolerance: late by one step, T dt / I."""

    torque: float = 0.02

    def wrench(self) -> Wrench:
        return Wrench(torque=(self.torque, 0.0, 0.0), start=self.start, end=self.end)

    def measure(self, world: World) -> Reading:
        return self._reading(world, 10, self.torque / (MASS * RADIUS**2 / 2))
