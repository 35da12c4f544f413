"""Resampling of trajectories."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.scene import Trajectory


@given(st.integers(2, 50), st.sampled_from([0.0005, 0.001, 0.002, 1 / 240, 0.004, 0.01]))
def test_a_linear_motion_stays_linear(rows: int, timestep: float) -> None:
    ramp = np.linspace(0.0, 1.0, rows)[:, None] * np.ones(3)
    trajectory = Trajectory(0.004, ramp, ramp, ramp)
    resampled = trajectory.resampled(timestep)
    steps = len(resampled.position)
    assert abs(steps * timestep - trajectory.duration) <= max(timestep / 2, timestep) + 1e-12
    expected = np.minimum(np.arange(1, steps + 1) * timestep / trajectory.duration, 1.0)
    assert np.allclose(resampled.position, expected[:, None], atol=1e-9)
