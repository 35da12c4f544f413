"""Quasi-static pushing: how sharply a block can be pushed round a curve.

A flat pusher keeps a block at rest against itself as long as the force that the motion needs acts
within their contact (Lynch and Mason, Stable Pushing, 1996). Friction under the block decides where
that is: each point that bears it resists with mu times its load against its own velocity (Coulomb;
Goyal, Ruina, Papadopoulos, Planar sliding with dry friction, 1991). How the load is spread does not
matter for mu, but for the lever. It is greatest where the corners bear all, as they do in engines.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from pytest_simbench.scene import FloatArray


def lever(points: FloatArray, radius: float) -> float:
    """How far beside the centre the pushing force must act, in a curve of the centre along the
    block's heading [m].

    Args:
        points: that bear equal shares of the load, x along the heading, from the centre [m],
            (n, 2).
        radius: of the curve [m].
    """
    x, y = points.T
    velocity = np.stack([1.0 - y / radius, x / radius])
    resisting = velocity / np.linalg.norm(velocity, axis=0)
    torque = x * resisting[1] - y * resisting[0]
    return float(torque.sum() / resisting[0].sum())


def smallest_turning_radius(length: float, width: float, contact: float) -> float:
    """The sharpest curve on which a block that stands on its corners stays at rest against the hand
    that pushes it [m].

    Args:
        length, width: edges of the block on the plane, along and across its heading [m].
        contact: width of the face that pushes, at the block's middle [m].
    """
    corners = np.array([[x, y] for x in (-length / 2, length / 2) for y in (-width / 2, width / 2)])
    farthest = length**2 / contact  # from where on the lever is (length / 2)^2 / radius
    return float(
        brentq(lambda r: lever(corners, r) - contact / 2, 0.51 * width, 10 * farthest + width)
    )
