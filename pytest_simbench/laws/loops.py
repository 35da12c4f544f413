"""Laws of loops of links: a four-bar linkage, whose coupler and rocker are held together by a
closure (`scene.Closure`)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from pytest_simbench.description.links import opening
from pytest_simbench.laws.base import Reading, Watched, rounding, solved
from pytest_simbench.laws.joints import JointMotion, Passive
from pytest_simbench.laws.mechanisms import MOUNT, Part, Y, mechanism
from pytest_simbench.scene import Closure, FloatArray, Robot, Vector3
from pytest_simbench.simulator import Capability, PreparedRobot

CRANK, COUPLER, ROCKER, GROUND = 0.25, 0.5, 0.4, 0.5
"""Lengths of the four bars [m]. Shortest and longest together are shorter than the others, so the
crank turns round and no posture is dead (Grashof 1883)."""

THIN = 1e-4
"""Moment of inertia of a rod about its own axis [kg m^2]; engines refuse 0."""

LOOKS = 250
"""At how many times, about, a loop is looked at."""

H = 1e-4
"""Step of central differences in the crank's angle [rad]: off by H^2, a part in 1e8, and rounded to
a part in 1e12, which the integrator below does not see."""


@dataclass(frozen=True)
class _FourBar(Passive, phenomenon="mechanisms", needs=(Capability.LOOPS,)):
    """Three rods: a crank and a rocker that hang on the mount, GROUND apart, and a coupler that is
    hinged to the crank and held at the rocker's end. It is let go at a crank angle."""

    crank: float = 1.2

    @property
    def mechanism(self) -> Robot:
        hinge = Closure("coupler link", "rocker link", (COUPLER, 0.0, 0.0), (0.0, 0.0, -ROCKER))
        return mechanism(self.name, *self.parts(), closures=(hinge,))

    def parts(self) -> tuple[Part, ...]:
        first, second, third = (float(angle) for angle in four_bar(self.crank))
        return (
            _rod("crank", CRANK, 0.5, first),
            _rod("coupler", COUPLER, 1.0, second, along=(1.0, 0.0, 0.0), at=(0.0, 0.0, -CRANK)),
            _rod("rocker", ROCKER, 1.0, third, at=(GROUND, 0.0, 0.0), on=MOUNT),
        )

    def exact(self, seconds: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Joint positions, velocities and accelerations, (n, 3) each.

        With the loop closed the crank's angle s tells all joints, q(s) (`four_bar`). Lagrange's
        equation of that one degree of freedom, with the inertia m(s) = q' M(q) q' and the potential
        energy V(s), is m s'' + m' s'^2 / 2 + V' = 0; by DOP853 with a relative tolerance of
        1e-8. M and V are Pinocchio's.
        """
        model = self.model
        data = model.createData()

        def inertia(s: float) -> float:
            return float(2 * pin.computeKineticEnergy(model, data, four_bar(s), slope(s)))

        def potential(s: float) -> float:
            return float(pin.computePotentialEnergy(model, data, four_bar(s)))

        def change(_: float, state: FloatArray) -> list[float]:
            s, rate = state
            m_slope = (inertia(s + H) - inertia(s - H)) / (2 * H)
            v_slope = (potential(s + H) - potential(s - H)) / (2 * H)
            return [rate, -(v_slope + m_slope * rate**2 / 2) / inertia(s)]

        s, rate = solved(change, [self.crank, 0.0], seconds, 200, 1e-8).T
        q = np.array([four_bar(value) for value in s])
        v = np.array([slope(value) for value in s]) * rate[:, None]
        return q, v, np.gradient(v, seconds / 199, axis=0)


def four_bar(crank: float) -> FloatArray:
    """Angles of crank, coupler (against the crank) and rocker of a closed loop, (3,) [rad].

    The crank's end and the rocker's foot are a known distance apart, and with coupler and rocker
    make a triangle; by the law of cosines (Freudenstein 1955 in closed form). Of both postures that
    in which coupler and rocker meet below.
    """
    end = CRANK * np.array([-math.sin(crank), -math.cos(crank)])  # x, z
    across = np.array([GROUND, 0.0]) - end
    far = float(np.hypot(*across))
    inner = math.acos((COUPLER**2 + far**2 - ROCKER**2) / (2 * COUPLER * far))
    direction = math.atan2(across[1], across[0]) - inner  # of the coupler, upward from x
    met = end + COUPLER * np.array([math.cos(direction), math.sin(direction)])
    rocker = math.atan2(GROUND - met[0], -met[1])
    return np.array([crank, -direction - crank, rocker])


def slope(crank: float) -> FloatArray:
    """How the three angles change with the crank's, (3,)."""
    return np.asarray((four_bar(crank + H) - four_bar(crank - H)) / (2 * H))


@dataclass(frozen=True)
class FourBarClosure(_FourBar, quantity="largest opening of the loop", unit="mm"):
    """A loop stays closed: in a four-bar linkage that swings, the coupler's end is where the
    rocker's is (Freudenstein, Approximate synthesis of four-bar linkages, 1955: the loop equation).
    Tolerance: one end is late by one step, the speed of the crank's end times dt; rounding of one
    step, since what holds the loop also restores it."""

    seconds: float = 2.0

    def read(self, seen: Watched) -> Reading:
        prepared = PreparedRobot(self.mechanism)
        some = seen.joints[:: max(1, seen.steps // LOOKS), 0]
        worst = max(opening(prepared, q) for q in some)
        _, v, _ = self.exact(self.seconds)
        fastest = CRANK * float(np.abs(v[:, 0]).max())
        return Reading(1000 * worst, 0.0, 1000 * (fastest * seen.dt + rounding(1.0, 1)))


@dataclass(frozen=True)
class FourBarSwing(_FourBar, JointMotion):
    """A four-bar linkage that is let go swings as its one degree of freedom has it: Lagrange's
    equation of the crank's angle, coupler and rocker by the loop equation. Tolerance as of
    `DoublePendulum`."""

    seconds: float = 1.0


def _rod(
    name: str,
    length: float,
    mass: float,
    start: float,
    along: Vector3 = (0.0, 0.0, -1.0),
    at: Vector3 = (0.0, 0.0, 0.0),
    on: str | None = None,
) -> Part:
    """A thin rod from its joint `along` an axis of its link."""
    x, y, z = along
    across = mass * length**2 / 12
    moments = (THIN if x else across, across, THIN if z else across)
    centre = (x * length / 2, y * length / 2, z * length / 2)
    return Part(name, Y, at, centre, mass, moments, start, on=on)
