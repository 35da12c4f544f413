"""Round shapes of links as hulls of corners: of links every engine reads boxes and meshes."""

from __future__ import annotations

import numpy as np

from pytest_simbench.scene import FloatArray
from pytest_simbench.scene.polytope import MOST


def cylinder(radius: float, half: float) -> tuple[FloatArray, float]:
    """Corners of a cylinder along z of that radius and half length [m], and by how much their hull
    is smaller at most [m]."""
    angles = np.linspace(0, 2 * np.pi, MOST // 2, endpoint=False)
    ring = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    ends = [np.hstack([ring, np.full((len(ring), 1), z)]) for z in (-half, half)]
    return np.concatenate(ends), radius * (1 - float(np.cos(np.pi / len(ring))))


def capsule(radius: float, half: float = 0.0) -> tuple[FloatArray, float]:
    """The same of a capsule, `half` the length between its ends' middles; 0: a sphere."""
    ways = directions(MOST)
    gap = radius * (1 - float((directions(400) @ ways.T).max(axis=1).min()))
    return radius * ways + np.array([0.0, 0.0, half]) * np.sign(ways[:, 2:]), gap


def directions(count: int) -> FloatArray:
    """Unit vectors, spread evenly over all directions (a spiral), (count, 3)."""
    z = 1 - (2 * np.arange(count) + 1) / count
    angle, flat = np.pi * (3 - np.sqrt(5)) * np.arange(count), np.sqrt(1 - z**2)
    return np.stack([flat * np.cos(angle), flat * np.sin(angle), z], axis=1)
