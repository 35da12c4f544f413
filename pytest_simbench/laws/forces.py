"""Laws of what bodies at rest press on each other with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pytest_simbench.client.world import World
from pytest_simbench.laws.base import GRAVITY, Law, Reading, rounding, watch
from pytest_simbench.laws.contact import CUBE, EDGE
from pytest_simbench.scene import Box, Pose, Scene
from pytest_simbench.simulator import Capability


@dataclass(frozen=True)
class RestForce(Law):
    """The ground carries a cube at rest with m g (Newton's first law).

    The force is the mean of a time T after one of settling, step by step. By the law of momentum
    it is m g and m (v1 - v0) / T. Tolerance: both speeds are late by one step, g dt each:
    2 m g dt / T.
    """

    name = "rest_force"
    phenomenon = "stacking"
    quantity: ClassVar[str] = "force upward"
    unit: ClassVar[str] = "N"
    needs: ClassVar[tuple[Capability, ...]] = (Capability.CONTACT_FORCES,)

    carrying: ClassVar[str] = "ground"
    masses: ClassVar[tuple[float, ...]] = (1.0,)
    settling: float = 0.3
    seconds: float = 0.1

    def build(self) -> Scene:
        bodies = [
            Box(f"cube {k}", CUBE, Pose.at(0.0, 0.0, EDGE * (k + 0.5)), mass)
            for k, mass in enumerate(self.masses)
        ]
        return Scene(self.name, tuple(bodies))

    @property
    def carried(self) -> tuple[str, float]:
        """The body that is pressed upward, and the mass that it carries, its own included [kg]."""
        return "body/cube 0", sum(self.masses)

    def measure(self, world: World) -> Reading:
        dt = watch(world, self.settling).dt
        body, mass = self.carried
        forces, count = [], max(1, round(self.seconds / dt))
        for _ in range(count):
            world.wait(dt)
            wrench = world.contact_forces().get((body, self.carrying))
            forces.append(0.0 if wrench is None else float(wrench[2]))
        weight = mass * GRAVITY
        allowed = 2 * weight / count + rounding(weight, 1)
        return Reading(float(np.mean(forces)), weight, allowed)


@dataclass(frozen=True)
class TowerForce(RestForce):
    """In a tower of four equal cubes the lowest carries the other three with 3 m g. Tolerance as of
    `RestForce`."""

    name = "tower_force"

    carrying: ClassVar[str] = "body/cube 0"
    masses: ClassVar[tuple[float, ...]] = (1.0,) * 4
    settling: float = 0.3
    seconds: float = 0.1

    @property
    def carried(self) -> tuple[str, float]:
        return "body/cube 1", sum(self.masses[1:])
