"""Laws of what a joint transmits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pytest_simbench.client.world import World
from pytest_simbench.laws.base import GRAVITY, Reading, rounding, watch
from pytest_simbench.laws.joints import Passive
from pytest_simbench.laws.mechanisms import INERTIA_OF_A_POINT, Part, Y
from pytest_simbench.scene import FloatArray
from pytest_simbench.simulator import Capability

LOOKS = 20
"""How often the joint is asked, at even times."""

MASS = 2.0
"""Of the bob [kg]."""


@dataclass(frozen=True)
class _Loaded(Passive, phenomenon="mechanisms", needs=(Capability.JOINT_WRENCHES,)):
    """A pendulum whose bob hangs aside of its plane: its hinge carries a force, and a torque
    across its axis."""

    which: ClassVar[slice]
    """Of a wrench: force or torque."""

    length: ClassVar[float] = 0.5
    aside: ClassVar[float] = 0.3
    angle: ClassVar[float] = 2.0

    seconds: float = 1.2

    def parts(self) -> tuple[Part, ...]:
        centre = (0.0, self.aside, -self.length)
        return (Part("swing", Y, centre=centre, mass=MASS, start=self.angle),)

    @property
    def slow(self) -> float:
        """m g l / I about the hinge [1/s^2]."""
        return MASS * GRAVITY * self.length / (MASS * self.length**2 + INERTIA_OF_A_POINT)

    def carried(self, angle: float) -> FloatArray:
        """The hinge's wrench on the rod at an angle [rad] while it swings, (6,).

        Newton: F = m (a - g) with the bob's acceleration, along and across the rod; the speed of
        the swing is that of energy conservation. Of the torque about the hinge, the part about its
        axis is 0, and that across it is the bob's way aside times F.
        """
        bend = -self.slow * math.sin(angle)
        inward = np.array([math.sin(angle), 0.0, math.cos(angle)])
        onward = np.array([-math.cos(angle), 0.0, math.sin(angle)])
        acceleration = self.length * (self.rate(angle) ** 2 * inward + bend * onward)
        force = MASS * (acceleration + np.array([0.0, 0.0, GRAVITY]))
        torque = np.cross([0.0, self.aside, 0.0], force)
        return np.concatenate([force, torque])

    def rate(self, angle: float) -> float:
        """Of the swing at an angle, by energy conservation [rad/s], (its size)."""
        fallen = math.cos(angle) - math.cos(self.angle)
        return math.sqrt(max(0.0, 2 * self.slow * fallen))

    def measure(self, world: World) -> Reading:
        """The largest error of force or torque, and by how much they change in a step."""
        errors = []
        for _ in range(LOOKS):
            dt = watch(world, self.seconds / LOOKS).dt
            told = world.joint_wrenches()[0] - self.carried(float(world.joints[0, 0]))
            errors.append(float(np.linalg.norm(told[self.which])))
        angles = np.linspace(-self.angle, self.angle, 401)
        right = np.array([self.carried(angle)[self.which] for angle in angles])
        bend = np.linalg.norm(np.gradient(right, angles, axis=0), axis=1)
        fastest = max(a * self.rate(angle) for a, angle in zip(bend, angles, strict=True))
        scale = float(np.linalg.norm(right, axis=1).max())
        return Reading(max(errors), 0.0, 2 * float(fastest) * dt + rounding(scale, 1))


@dataclass(frozen=True)
class PendulumForce(
    _Loaded, quantity="largest error of the hinge's force", unit="N", which=slice(0, 3)
):
    """The hinge of a pendulum carries F = m (a - g): along the rod m g cos q + m l w^2, and across
    it what an inertia about the bob's centre asks for (Newton; Huygens, Horologium oscillatorium,
    1673). Tolerance: what is told is of the last step, whose begin is one step ago, and the speed
    was late by one then: two steps, 2 dt times the largest |dF/dt| of the swing."""


@dataclass(frozen=True)
class PendulumTorque(
    _Loaded, quantity="largest error of the hinge's torque", unit="N m", which=slice(3, 6)
):
    """The hinge of a pendulum whose bob hangs aside of its plane carries a torque across its axis,
    the bob's way aside times the force, and none about it (Euler's second law). Tolerance as of
    `PendulumForce`, of the torque."""
