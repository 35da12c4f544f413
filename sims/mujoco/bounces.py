"""Restitution of a spring and a damper: for engines whose contacts know no coefficient.

A mass that meets a linear spring with a damper of ratio z leaves it when their force ends, before
half a period (Schwager and Poeschel, Granular Matter 9, 2007, equation 15):
e = exp(-z / sqrt(1 - z^2) (pi - atan(2 z sqrt(1 - z^2) / (1 - 2 z^2)))).
"""

from __future__ import annotations

import math

LARGEST = math.sqrt(0.5)
"""z up to which the formula holds; e is 0.21 there."""

SHARE = 0.25
"""Angle that the oscillation of a contact that bounces turns by in a step [rad]: an impact takes
twelve steps then, goes as deep as the body moves in four, and keeps e within 0.03 (MuJoCo 4.0, a
ball at 1 to 3.3 m/s, e from 0.3 to 1); 0.5 keeps it within 0.08, and goes half as deep."""

BOUNCES = (
    "restitution is a spring with a damper: an impact takes twelve steps, and is as deep as the "
    "body moves in four; e is met within 0.03, and none below 0.21 can be had"
)
"""What MuJoCo, Newton and Genesis declare of it."""


def damping_ratio(restitution: float) -> float:
    """z of a contact that leaves `restitution` (above 0) of the speed; the largest that
    `restitution_of` knows where it would have to leave less."""
    low, high = 0.0, LARGEST
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if restitution_of(middle) > restitution else (low, middle)
    return low


def restitution_of(ratio: float) -> float:
    """e of a contact with damping ratio z; 0 from `LARGEST` on."""
    if ratio >= LARGEST:
        return 0.0
    root = math.sqrt(1 - ratio**2)
    parting = math.pi - math.atan(2 * ratio * root / (1 - 2 * ratio**2))
    return math.exp(-ratio / root * parting)


def direct(restitution: float, timestep: float) -> tuple[float, float]:
    """`solref` of such a contact: minus stiffness [1/s^2] and damping [1/s] per mass."""
    frequency = SHARE / timestep
    return -(frequency**2), -2 * damping_ratio(restitution) * frequency


def bounce(first: float, second: float) -> float:
    """Restitution of a contact's linear spring and damper, from MuJoCo's `solref`.

    That is (time constant, damping ratio), or minus stiffness and damping per mass.
    """
    ratio = second if first > 0 else -second / (2 * math.sqrt(-first)) if first < 0 else 0.0
    return restitution_of(ratio)
