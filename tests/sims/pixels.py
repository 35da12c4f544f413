"""Where the camera that all engines share sees a point."""

from __future__ import annotations

import numpy as np

from pytest_simbench.scene import FloatArray
from pytest_simbench.simulator.base import EYE, FIELD_OF_VIEW, view_axes

WIDTH, HEIGHT = 320, 240
RED = (0.9, 0.05, 0.05, 1.0)


def pixel(point: FloatArray) -> tuple[int, int]:
    """Row and column of a point in the picture of a pinhole camera at `EYE`, upright."""
    right, down, ahead = view_axes().T
    offset = point - np.array(EYE)
    focal = HEIGHT / 2 / np.tan(FIELD_OF_VIEW / 2)
    x, y = focal * np.array([offset @ right, offset @ down]) / (offset @ ahead)
    return int(HEIGHT / 2 + y), int(WIDTH / 2 + x)


def red(picture: np.ndarray) -> np.ndarray:
    """Which pixels are red, (height, width)."""
    colours = picture.astype(int)
    return np.asarray(colours[:, :, 0] > 2 * colours[:, :, 1:].max(axis=2))
