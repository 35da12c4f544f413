"""Laws of forces that act on a body for a time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pytest_simbench.client.world import World
from pytest_simbench.laws.base import Law, Reading, rounding, watch
from pytest_simbench.laws.free import FREE, WEIGHTLESS
from pytest_simbench.scene import Cylinder, Pose, Scene, Wrench

RADIUS, LENGTH, MASS = 0.05, 0.3, 2.0


@dataclass(frozen=True)
class AxialForce(Law):
    """A rod that a force pulls along its axis from t0 to t1 has v = F (t1 - t0) / m from then on
    (Newton's second law). Tolerance: late by one step, F dt / m."""

    name = "axial_force"
    phenomenon = FREE
    quantity: ClassVar[str] = "speed along the axis"
    unit: ClassVar[str] = "m/s"

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
        allowed = rate * seen.dt + rounding(exact, seen.steps)
        return Reading(float(seen.bodies[-1, 0, column]), exact, allowed)


@dataclass(frozen=True)
class AxialTorque(AxialForce):
    """A rod under a torque about its axis has omega = T (t1 - t0) / I with I = m r^2 / 2.
    Tolerance: late by one step, T dt / I."""

    name = "axial_torque"
    quantity: ClassVar[str] = "angular velocity about the axis"
    unit: ClassVar[str] = "rad/s"

    torque: float = 0.02

    def wrench(self) -> Wrench:
        return Wrench(torque=(self.torque, 0.0, 0.0), start=self.start, end=self.end)

    def measure(self, world: World) -> Reading:
        return self._reading(world, 10, self.torque / (MASS * RADIUS**2 / 2))
