"""Resampling of trajectories."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.scene import SceneError, Trajectory


@given(st.integers(2, 50), st.sampled_from([0.0005, 0.001, 0.002, 1 / 240, 0.004, 0.01]))
def test_a_linear_motion_stays_linear(rows: int, timestep: float) -> None:
    ramp = np.linspace(0.0, 1.0, rows)[:, None] * np.ones(3)
    trajectory = Trajectory(0.004, ramp, ramp, ramp)
    resampled = trajectory.resampled(timestep)
    steps = len(resampled.position)
    assert abs(steps * timestep - trajectory.duration) <= max(timestep / 2, timestep) + 1e-12
    expected = np.minimum(np.arange(1, steps + 1) * timestep / trajectory.duration, 1.0)
    assert np.allclose(resampled.position, expected[:, None], atol=1e-9)


@pytest.mark.parametrize(
    ("tick", "shape", "value", "said"),
    [
        (0.0, (3, 2), 0.0, "the tick .* is 0.0"),
        (math.nan, (3, 2), 0.0, "the tick .* is nan"),
        (0.1, (3,), 0.0, r"a trajectory of the shapes \(3,\), \(3, 2\), \(3, 2\)"),
        (0.1, (2, 2), 0.0, "a trajectory of the shapes"),
        (0.1, (0, 2), 0.0, "a trajectory of the shapes"),
        (0.1, (3, 2), math.nan, "a trajectory holds a number that is not finite"),
        (0.1, (3, 2), math.inf, "a trajectory holds a number that is not finite"),
    ],
)
def test_a_motion_that_is_none(
    tick: float, shape: tuple[int, ...], value: float, said: str
) -> None:
    rows = np.zeros((3, 2))
    with pytest.raises(SceneError, match=said):
        Trajectory(tick, np.full(shape, value), rows, rows)
