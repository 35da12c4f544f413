"""The law of a row of dominoes. Each plate is hinged at its foot, so that no foot slips: where feet
slip, Coulomb's law does not settle the impacts."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.integrate import quad

from pytest_simbench.client.world import World
from pytest_simbench.laws.base import GRAVITY, Law, Reading, watch
from pytest_simbench.laws.mechanisms import MOUNT, Part, Y, mechanism
from pytest_simbench.scene import FloatArray, Scene, Vector3
from pytest_simbench.simulator import Capability

HEIGHT, THICKNESS, WIDTH = 1.0, 0.1, 0.25
"""Of a plate [m]."""

PITCH = 0.5
"""From one hinge to the next [m]; the gap between plates is 0.4 of their height."""

MASS = 1.0
"""Of a plate [kg]."""

INERTIA = MASS * (HEIGHT**2 / 3 + THICKNESS**2 / 12)
"""About the hinge, in the middle of the foot [kg m^2]."""

REACH, ASIDE = math.hypot(HEIGHT, THICKNESS / 2), math.atan2(THICKNESS / 2, HEIGHT)
"""From the hinge to the leading upper edge: distance [m], and angle off the plate [rad]."""

START = 0.2
"""How far the first plate leans when it is let go [rad]. All others stand upright, in balance."""


def behind(lean: float) -> float:
    """How far a plate leans that touches the back of one that leans by `lean` [rad].

    Its leading upper edge is on the face, which is half a thickness behind the hinge: with a and b
    for the two, REACH sin(a - b + ASIDE) = PITCH cos(b) - THICKNESS / 2.
    """
    return lean + math.asin((PITCH * math.cos(lean) - THICKNESS / 2) / REACH) - ASIDE


def slope(lean: float) -> float:
    """How fast it turns, over how fast the plate that leans by `lean` does."""
    across = PITCH * math.cos(lean) - THICKNESS / 2
    return 1 - PITCH * math.sin(lean) / math.sqrt(REACH**2 - across**2)


STRIKE = behind(0.0)
"""How far a plate leans when it strikes the next one [rad]."""


def train(lean: float, count: int) -> tuple[FloatArray, FloatArray]:
    """Plates that lean on each other, from the foremost back: how far each leans [rad], and how
    fast it turns over how fast the foremost does, (count,) each."""
    leans, rates = [lean], [1.0]
    while len(leans) < count:
        rates.append(rates[-1] * slope(leans[-1]))
        leans.append(behind(leans[-1]))
    return np.array(leans), np.array(rates)


def inertia(lean: float, count: int) -> float:
    """Of a train, as its foremost plate feels it [kg m^2]."""
    _, rates = train(lean, count)
    return INERTIA * float(rates @ rates)


def potential(lean: float, count: int) -> float:
    """Energy of a train's weight, above the hinges [J]."""
    leans, _ = train(lean, count)
    return MASS * GRAVITY * HEIGHT / 2 * float(np.cos(leans).sum())


def passages(plates: int) -> FloatArray:
    """How long each plate but the first one moves until it leans by STRIKE, (plates - 1,) [s].

    A train has one degree of freedom, the lean of its foremost plate, and keeps its energy E until
    that strikes: with its inertia m and potential V, t is the integral of (m / 2 (E - V))^1/2 over
    the lean. The struck plate stands upright, and its face is as high above its hinge where it is
    struck as the striking edge is above its own: it goes on as fast as the foremost one. An
    impulse between plates that stay together does no work, so what is conserved is the momentum of
    that motion, m w = (m + INERTIA) w', and m / (m + INERTIA) of the kinetic energy is left.
    """
    energy, times = potential(START, 1), []
    for count in range(1, plates + 1):

        def speed(lean: float, count: int = count, energy: float = energy) -> float:
            return math.sqrt(2 * (energy - potential(lean, count)) / inertia(lean, count))

        if count > 1:
            times.append(quad(lambda lean: 1 / speed(lean), 0.0, STRIKE, epsrel=1e-10)[0])
        moving = inertia(STRIKE, count)
        kinetic = energy - potential(STRIKE, count)
        energy = potential(0.0, count + 1) + kinetic * moving / (moving + INERTIA)
    return np.array(times)


@dataclass(frozen=True)
class DominoWave(
    Law,
    phenomenon="mechanisms",
    quantity="speed of the wave",
    unit="m/s",
    needs=(Capability.SELF_COLLIDE,),
):
    """In a row of plates hinged at their feet each strikes the next, inelastically, and all that
    fell stay together and push: a train of one degree of freedom between impacts (van Leeuwen, The
    domino effect, Am. J. Phys. 78, 721, 2010, without friction; `passages`). The speed is that from
    where the first plate strikes to where the last one would. Tolerance: each impact is late by
    one step, in its place and in its speed, so each of the passages may take two steps longer."""

    plates: int = 8

    def build(self) -> Scene:
        row = (_plate(k, START if k == 0 else 0.0) for k in range(self.plates))
        robot = mechanism(self.name, *row, friction=0.0, self_collide=True)
        return Scene(self.name, robot=robot, ground_friction=0.0)

    def measure(self, world: World) -> Reading:
        """The speed is 0 if the wave ends on its way."""
        exact = passages(self.plates)
        seen = watch(world, 1.5 * (fall() + exact.sum()))
        passed = (seen.crossings(seen.joints[:, 0, plate], STRIKE) for plate in (0, -1))
        first, last = (float(times[0]) if len(times) else math.inf for times in passed)
        way, seconds = PITCH * len(exact), float(exact.sum())
        right = way / seconds
        speed = way / (last - first) if last > first else 0.0
        return seen.reading(speed, right, right * 2 * len(exact) / seconds, right)


def fall() -> float:
    """How long the first plate falls until it strikes [s]. At the start its speed is 0; in the
    root of how far it fell, the integral has no pole there."""
    start = potential(START, 1)

    def share(root: float) -> float:
        gained = start - potential(START + root**2, 1)
        return 2 * root * math.sqrt(INERTIA / (2 * gained))

    return float(quad(share, 0.0, math.sqrt(STRIKE - START))[0])


def _plate(number: int, lean: float) -> Part:
    size: Vector3 = (THICKNESS, WIDTH, HEIGHT)
    moments = tuple(MASS * (sum(edge**2 for edge in size) - edge**2) / 12 for edge in size)
    x, y, z = moments
    at, centre = (number * PITCH, 0.0, 0.0), (0.0, 0.0, HEIGHT / 2)
    return Part(f"plate {number}", Y, at, centre, MASS, (x, y, z), lean, shape=size, on=MOUNT)
