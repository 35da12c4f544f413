"""MuJoCo's offscreen pictures, for the adapters of MuJoCo and Newton.

MuJoCo loads an OpenGL driver when it is imported (`MUJOCO_GL=egl`): 4 to 65 MB of memory, by the
driver, that a headless repetition never uses. So the adapters import it with `MUJOCO_GL=disabled`,
and the driver comes with the first picture.
"""

from __future__ import annotations

import importlib
import math
import os
from types import ModuleType
from typing import Any

import numpy as np

from pytest_simbench.simulator.base import EYE, FIELD_OF_VIEW, LOOK_AT

DISABLED = {"MUJOCO_GL": "disabled"}
"""The environment of a headless import."""


def renderer(mujoco: Any, model: Any, width: int, height: int) -> Any:
    """A `mujoco.Renderer`; loads the driver (EGL) where MuJoCo was imported without one."""
    context = gl_context()
    if not hasattr(context, "GLContext"):
        os.environ["MUJOCO_GL"] = "egl"
        importlib.reload(context)
    model.vis.global_.fovy = math.degrees(FIELD_OF_VIEW)
    model.vis.quality.shadowsize = 1024  # of 4096: a software renderer is twice as fast
    model.vis.headlight.ambient[:] = 0.4
    return mujoco.Renderer(model, height, width)


def camera(mujoco: Any) -> Any:
    """An `MjvCamera` at the place that all engines share."""
    found, (x, y, z) = mujoco.MjvCamera(), np.subtract(LOOK_AT, EYE)
    found.lookat[:], found.distance = LOOK_AT, math.hypot(x, y, z)
    found.azimuth = math.degrees(math.atan2(y, x))
    found.elevation = math.degrees(math.asin(z / found.distance))
    return found


def gl_context() -> ModuleType:
    """The module that loads the OpenGL driver; from 3.10 on it is below `rendering`."""
    try:
        return importlib.import_module("mujoco.rendering.classic.gl_context")
    except ModuleNotFoundError:
        return importlib.import_module("mujoco.gl_context")
