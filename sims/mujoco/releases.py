"""Where MuJoCo's releases differ for this adapter."""

from __future__ import annotations

import importlib
from types import ModuleType
from typing import Any

OLDEST = "3.2.4"
"""Before it the lists of `MjSpec` (geoms, joints) cannot be read in Python."""


def joint(spec: Any, name: str) -> Any:
    """The joint of that name."""
    if hasattr(spec, "joint"):
        return spec.joint(name)
    return next(joint for joint in spec.joints if joint.name == name)  # before 3.3.0


def equality_data(mujoco: Any, coefficients: list[float]) -> list[float]:
    """The data of an equality constraint: 11 numbers, from 3.17 on 12."""
    return [*coefficients, *[0.0] * (mujoco.mjNEQDATA - len(coefficients))]


def gl_context() -> ModuleType:
    """The module that loads the OpenGL driver; from 3.10 on it is below `rendering`."""
    try:
        return importlib.import_module("mujoco.rendering.classic.gl_context")
    except ModuleNotFoundError:
        return importlib.import_module("mujoco.gl_context")
