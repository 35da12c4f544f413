"""MuJoCo's offscreen pictures, for the adapters of MuJoCo and Newton.

MuJoCo loads an OpenGL driver when it is imported (`MUJOCO_GL=egl`): 4 to 65 MB of memory, by the
driver, that a headless repetition never uses. So the adapters import it with `MUJOCO_GL=disabled`,
and the driver comes with the first picture.
"""

from __future__ import annotations

import importlib
import os
from typing import Any

DISABLED = {"MUJOCO_GL": "disabled"}
"""The environment of a headless import."""


def renderer(mujoco: Any, model: Any, width: int, height: int) -> Any:
    """A `mujoco.Renderer`; loads the driver (EGL) where MuJoCo was imported without one."""
    context = importlib.import_module("mujoco.rendering.classic.gl_context")
    if not hasattr(context, "GLContext"):
        os.environ["MUJOCO_GL"] = "egl"
        importlib.reload(context)
    return mujoco.Renderer(model, height, width)
