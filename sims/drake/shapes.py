"""Collision shapes that Drake's adapter adds: spheres in corners.

Nothing here needs the engine.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from pytest_simbench.scene import FloatArray
from pytest_simbench.simulator import PreparedRobot
from pytest_simbench.simulator.urdf import MovingJoint


def corner_centres(size: Sequence[float], radius: float) -> FloatArray:
    """Centres (8, 3) [m] of spheres that touch three faces each of a box of `size`, from within."""
    return np.array(list(product((-1.0, 1.0), repeat=3))) * (np.asarray(size) / 2 - radius)


def fitting_radius(size: Sequence[float], radius: float) -> float:
    """`radius`, or what fits twice along the box's shortest edge [m]."""
    return min(radius, min(size) / 4)


def pad_centres(prepared: PreparedRobot, finger: MovingJoint, radius: float) -> FloatArray:
    """Centres (n, 3) [m] of spheres behind the corners of a finger's gripping face.

    The finger's joint opens along its axis, so its gripping face is that of its boxes which lies
    farthest against the axis. The centres are in the link's frame.
    """
    boxes = [s for s in prepared.links[finger.child].shapes if s.size is not None]
    if not boxes:
        return np.empty((0, 3))
    centres = np.vstack(
        [
            corner_centres(box.size or (), radius) @ box.pose.rotation().T + box.pose.position
            for box in boxes
        ]
    )
    depth = centres @ np.asarray(finger.axis)
    return np.asarray(centres[depth < depth.min() + 1e-5])
