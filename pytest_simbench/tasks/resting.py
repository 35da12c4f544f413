"""The end of a task: how calmly do things rest?"""

from __future__ import annotations

import numpy as np

from pytest_simbench.client.motion import Motion
from pytest_simbench.client.world import World
from pytest_simbench.scene import FloatArray

RESTLESS = 0.5
"""The last seconds over which it is measured how calmly things rest [s]."""

LOG_PERIOD = 0.01
"""Between two samples of a motion [s]."""


def rest(world: World, seconds: float, phase: str) -> Motion:
    """Wait for so long [s] and return the motion of the last `RESTLESS`."""
    with world.phase(phase):
        world.wait(max(seconds - RESTLESS, RESTLESS))
    with world.phase("rest"):
        seen = world.wait(RESTLESS, log_period=LOG_PERIOD)
    assert seen is not None  # a log was asked for
    return seen


def rates(time: FloatArray, values: FloatArray) -> FloatArray:
    """Root mean squares of the rates at which values change, (...).

    They are of the values: the speeds that an engine tells may be others.

    Args:
        time: of the samples [s], (n,).
        values: (n, ...).
    """
    step = np.diff(time).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(np.sqrt(np.mean((np.diff(values, axis=0) / step) ** 2, axis=0)))
