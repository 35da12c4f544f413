"""How deep boxes overlap, many pairs at once: the separating-axis test."""

from __future__ import annotations

import numpy as np

from pytest_simbench.scene.pose import FloatArray

PARALLEL = 1e-9
"""Two edges whose directions' product is shorter than this are parallel and give no axis."""


def rotations(quaternions: FloatArray) -> FloatArray:
    """Rotation matrices (n, 3, 3) of quaternions w, x, y, z, (n, 4), normalised first."""
    w, x, y, z = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def overlaps(
    offset: FloatArray,
    turn_a: FloatArray,
    half_a: FloatArray,
    turn_b: FloatArray,
    half_b: FloatArray,
) -> FloatArray:
    """How far each pair of boxes would have to be moved apart [m], (n,); below 0: they are apart.

    Two convex boxes are apart when one of 15 axes (3 face normals each and the 9 products of their
    edges) separates their projections.

    Args:
        offset: from the centre of a to that of b [m], (n, 3).
        turn_a, turn_b: their rotation matrices, (n, 3, 3).
        half_a, half_b: half of their edges [m], (n, 3).
    """
    edges_a, edges_b = turn_a.transpose(0, 2, 1), turn_b.transpose(0, 2, 1)  # rows are edges
    crosses = np.cross(edges_a[:, :, None], edges_b[:, None]).reshape(-1, 9, 3)
    axes = np.concatenate([edges_a, edges_b, crosses], axis=1)
    lengths = np.linalg.norm(axes, axis=2)
    real = lengths > PARALLEL
    axes = axes / np.where(real, lengths, 1.0)[:, :, None]
    reach = np.einsum("nki,ni->nk", np.abs(axes @ turn_a), half_a)
    reach += np.einsum("nki,ni->nk", np.abs(axes @ turn_b), half_b)
    away = np.abs(np.einsum("nki,ni->nk", axes, offset))
    depth: FloatArray = np.where(real, reach - away, np.inf).min(axis=1)
    return depth
