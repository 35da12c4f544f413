"""Checks that ask a law of `pytest_simbench.laws`, within a bound of the kit: the tolerance of a
law is that of an integrator, and soft contacts of honest engines exceed it."""

from __future__ import annotations

from pytest_simbench.laws.contact import RestDepth, Tower
from pytest_simbench.laws.free import (
    AxialForce,
    AxialTorque,
    FallSpeed,
    ObliqueGravity,
    Spin,
    TumbleEnergy,
    TumbleMomentum,
)
from pytest_simbench.laws.impact import DeadLanding
from pytest_simbench.laws.rolling import RollingCylinder, SlipToRoll
from pytest_simbench.laws.sliding import BeltSpeed, SlideDiagonal, SlideX
from pytest_simbench.laws.sticking import Creep
from pytest_simbench.testing.kit import check
from pytest_simbench.testing.scenes import GRAVITY
from pytest_simbench.testing.subject import Subject, asked

MU = 0.05 * SlideX().friction * GRAVITY * 0.8
"""What 5 % of the friction change of a slab's acceleration [m/s^2]."""


@check()
def free_fall(subject: Subject) -> None:
    """After 1 s a body that falls has the speed g t, and where gravity is oblique it is at g t^2
    / 2 in each direction: first-order integrators are late by one step, g dt and g t dt. Damping of
    0.04 / s costs 0.19 m/s and is found."""
    asked(subject, FallSpeed(), ObliqueGravity())


@check()
def rest_on_plane(subject: Subject) -> None:
    """A cube put on the ground stays for 3 s, within 1 mm."""
    asked(subject, RestDepth(seconds=3.0), within=1e-3)


@check()
def tower_stands(subject: Subject) -> None:
    """Five cubes upon each other stay for 5 s, the top one within 5 mm of its place."""
    asked(subject, Tower(seconds=5.0), within=5e-3)


@check()
def nothing_bounces(subject: Subject) -> None:
    """A cube that falls flat upon the ground from 0.1 m rises again by at most a tenth of that
    (restitution below 0.32)."""
    asked(subject, DeadLanding(height=0.1), within=0.01)


@check()
def slides_above_mu(subject: Subject) -> None:
    """Down a slope steeper than mu a slab accelerates by g (sin - mu cos); mu within 5 %."""
    asked(subject, SlideX(), within=MU)


@check()
def slides_alike_diagonally(subject: Subject) -> None:
    """The same along a diagonal of the axes, where a friction pyramid differs from the cone."""
    asked(subject, SlideDiagonal(), within=MU)


@check()
def sticks_below_mu(subject: Subject) -> None:
    """On a slope of 0.8 mu a slab stays: less than 1 mm in 1 s, the settling left out."""
    asked(subject, Creep(), within=1e-3)


@check()
def ball_rolls(subject: Subject) -> None:
    """A ball set sliding at 1 m/s comes to roll with 5/7 of it, within 2 %, and keeps that to the
    end of 1 s: its angular momentum about the contact stays."""
    asked(subject, SlipToRoll(seconds=1.0), within=0.02 * 5 / 7)


@check()
def can_rolls(subject: Subject) -> None:
    """Down a slope a lying cylinder rolls with 2/3 of the acceleration of what slips, within 2 %
    (of 1.88 m/s^2)."""
    asked(subject, RollingCylinder(), within=0.02 * 1.88)


@check()
def cube_spins_on(subject: Subject) -> None:
    """What spins about a principal axis in free flight keeps its angular velocity within 1 %,
    whatever the integrator."""
    asked(subject, Spin(), within=0.01 * Spin().spin)


@check()
def brick_tumbles_on(subject: Subject) -> None:
    """A brick with three different moments of inertia that turns over keeps rotational energy and
    angular momentum within 10 %: engines integrate the gyroscopic torque to first order, or leave
    it out."""
    asked(subject, TumbleEnergy(), TumbleMomentum(), within=10.0)


@check()
def force_acts_for_its_time(subject: Subject) -> None:
    """A rod without weight, pulled by F for 0.4 s, has v = F t / m from then on: within 0.1 %. A
    force that acts for a step too long gives more than that."""
    asked(subject, AxialForce(), within=1e-3)


@check()
def torque_acts_for_its_time(subject: Subject) -> None:
    """A lying rod under a torque T about its axis, which is the world's x, has omega = T t / I in
    the same way."""
    asked(subject, AxialTorque(), within=3.2e-3)


@check()
def belt_carries(subject: Subject) -> None:
    """A box laid on a belt of 0.8 m/s slips until it goes with it, as friction has it: after 0.6 s
    it has gone 0.4 m, within 2 %."""
    asked(subject, BeltSpeed(), within=0.008)
