"""Quasi-static pushing by the limit surface: how sharply a block can be pushed round a curve.

A block that slides slowly on a plane turns about a point that the pushing force chooses. The limit
surface, an ellipsoid in force and torque, ties the two: the twist is its normal at the wrench
(Goyal, Ruina, Papadopoulos 1991; the ellipsoid is Howe and Cutkosky's approximation, 1996). A flat
pusher keeps a block at rest against itself as long as the wrench that the motion needs lies in
the cone of what the contact can give (Lynch and Mason, Stable Pushing, 1996).
"""

from __future__ import annotations

import math


def friction_radius(length: float, width: float) -> float:
    """Largest friction torque of a rectangle that slides, over its largest friction force [m].

    Under an even pressure it is the mean distance from the centre: 0.3826 edges for a square.

    Args:
        length, width: edges of the rectangle [m].
    """
    a, b = length / 2, width / 2
    diagonal = math.hypot(a, b)
    sides = a**3 * math.asinh(b / a) + b**3 * math.asinh(a / b)
    return (2 * a * b * diagonal + sides) / (6 * a * b)


def smallest_turning_radius(length: float, width: float, contact: float) -> float:
    """The sharpest curve of a block's centre, along its heading, on which it stays at rest against
    the flat hand that pushes it [m].

    The motion v, v / R needs the force f and the torque f c^2 / R, with c the friction radius. The
    friction of the contact gives no torque without a force to the side, so the force must act
    within the contact: c^2 / R <= contact / 2.

    Args:
        length, width: edges of the block on the plane [m].
        contact: width of the face that pushes, at the block's middle [m].
    """
    return 2 * friction_radius(length, width) ** 2 / contact
