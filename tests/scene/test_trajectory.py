"""Resampling of trajectories."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.scene import SceneError, Trajectory

TIMESTEPS = st.sampled_from([0.0005, 0.001, 0.002, 1 / 240, 0.004, 0.01])


@given(st.integers(2, 50), TIMESTEPS)
def test_a_linear_motion_stays_linear_and_each_array_itself(rows: int, timestep: float) -> None:
    ramp = np.linspace(0.0, 1.0, rows)[:, None] * np.ones(3)
    trajectory = Trajectory(0.004, ramp, 2 * ramp, -3 * ramp)
    resampled = trajectory.resampled(timestep)
    steps = len(resampled.position)
    share = np.minimum(np.arange(1, steps + 1) * timestep / trajectory.duration, 1.0)[:, None]
    assert np.allclose(resampled.position, share, atol=1e-9)
    assert np.allclose(resampled.velocity, 2 * share, atol=1e-9)
    assert np.allclose(resampled.effort, -3 * share, atol=1e-9)
    assert resampled.tick == timestep


def test_one_set_point_is_held_at_rest() -> None:
    goal, effort = np.array([0.1, -0.2]), np.array([3.0, 4.0])
    held = Trajectory.holding(0.004, goal, effort)
    assert (held.tick, held.duration) == (0.004, 0.004)
    assert held.position.tolist() == [goal.tolist()] * 2
    assert held.velocity.tolist() == [[0.0, 0.0]] * 2
    assert held.effort.tolist() == [effort.tolist()] * 2
    assert Trajectory.holding(0.004, goal).effort.tolist() == [[0.0, 0.0]] * 2


@given(st.integers(2, 50), TIMESTEPS)
def test_it_ends_within_half_a_step_of_its_end(rows: int, timestep: float) -> None:
    """No step is left out or added, but that there is always one."""
    flat = np.zeros((rows, 1))
    trajectory = Trajectory(0.004, flat, flat, flat)
    late = len(trajectory.resampled(timestep).position) * timestep - trajectory.duration
    assert late <= timestep / 2 + 1e-12 or trajectory.duration < timestep / 2
    assert late >= -timestep / 2 - 1e-12


@pytest.mark.parametrize(
    ("timestep", "expected"),
    [
        (0.004, [1.0, 4.0, 9.0]),  # at the rows: row 0, the start, is not commanded again
        (0.002, [0.5, 1.0, 2.5, 4.0, 6.5, 9.0]),  # between them, straight
        (0.008, [4.0, 9.0]),  # beyond the end, the end
        (0.1, [9.0]),
    ],
)
def test_a_bent_motion_is_sampled_straight_between_its_rows(
    timestep: float, expected: list[float]
) -> None:
    rows = np.array([[0.0], [1.0], [4.0], [9.0]])
    found = Trajectory(0.004, rows, rows, rows).resampled(timestep)
    assert found.position.ravel().tolist() == pytest.approx(expected)


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
