"""Binary STL, the one form in which robots have meshes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pytest_simbench.scene import FloatArray

HEADER = 84
"""[bytes]: 80, and the number of triangles (uint32)."""

TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
"""One record a triangle after that."""


def read_stl(data: bytes) -> FloatArray:
    """The corners of the triangles, (n, 3, 3); none where the data are something else."""
    count = int.from_bytes(data[HEADER - 4 : HEADER], "little")
    if len(data) != HEADER + count * TRIANGLE.itemsize:
        return np.empty((0, 3, 3))
    return np.asarray(np.frombuffer(data, TRIANGLE, count, HEADER)["corners"], dtype=float)


def written_stl(corners: ArrayLike, normals: ArrayLike = 0.0) -> bytes:
    """A file of triangles: their corners, (n, 3, 3), counter-clockwise from outside, and normals,
    (n, 3)."""
    triangles = np.zeros(len(np.asarray(corners)), TRIANGLE)
    triangles["corners"], triangles["normal"] = corners, normals
    return bytes(HEADER - 4) + np.uint32(len(triangles)).tobytes() + triangles.tobytes()
