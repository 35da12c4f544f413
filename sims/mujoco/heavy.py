"""Heavy bodies in MuJoCo, which stand for prescribed ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np


def leave_out(model: Any, first: Sequence[int]) -> None:
    """Have the solver stop where it would without these bodies: its tolerance is relative to the
    mean inertia of all degrees of freedom.

    Args:
        model: of MuJoCo.
        first: degree of freedom of each heavy body.
    """
    light = np.delete(model.dof_M0, [dof + k for dof in first for k in range(6)])
    model.stat.meaninertia = light.mean() if len(light) else 1.0
