"""A trace as a page holds it: whole numbers, column by column, each as the difference to the one
before. What stands still is zeros then, and packs to nothing."""

from __future__ import annotations

import base64
import zlib

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.recordings.trace import Trace

SCALE = 10_000
"""Steps per unit: 0.1 mm, 0.1 mrad, 0.1 ms."""

FARTHEST = 1e4
"""Nothing is drawn farther away [m]."""


def columns(trace: Trace) -> NDArray[np.int32]:
    """Time, then each joint's position, then seven columns a free body, (columns, n)."""
    table = np.column_stack(
        [
            trace.time,
            trace.joints[:, 0],
            trace.bodies[:, :, :7].reshape(len(trace.time), -1),
        ]
    )
    return np.asarray(np.rint(np.clip(table, -FARTHEST, FARTHEST) * SCALE).T, dtype="<i4")


def packed(trace: Trace) -> str:
    """The columns as differences, packed (zlib) and as text (base64)."""
    steps = np.diff(columns(trace), axis=1, prepend=0).astype("<i4")
    return base64.b64encode(zlib.compress(steps.tobytes(), 9)).decode("ascii")
