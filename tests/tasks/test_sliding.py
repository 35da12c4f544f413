"""Levers of sliding blocks, where they are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.tasks.pushing import lever, smallest_turning_radius

EDGES = st.floats(0.02, 0.5)


def corners(length: float, width: float) -> np.ndarray:
    return np.array([[x, y] for x in (-1, 1) for y in (-1, 1)]) * [length / 2, width / 2]


def spread(length: float, width: float) -> np.ndarray:
    """Even pressure."""
    middles = (np.arange(100) + 0.5) / 100 - 0.5
    return np.stack(np.meshgrid(length * middles, width * middles), axis=-1).reshape(-1, 2)


@given(EDGES, EDGES)
def test_in_a_wide_curve_it_is_the_mean_square_of_the_length_over_the_radius(
    length: float, width: float
) -> None:
    """Friction turns aside by x / R where the block moves so; to first order nothing else does."""
    radius = 100.0
    assert lever(corners(length, width), radius) == pytest.approx(length**2 / 4 / radius, rel=0.02)
    assert lever(spread(length, width), radius) == pytest.approx(length**2 / 12 / radius, rel=0.02)


@given(EDGES, EDGES, st.floats(0.3, 3.0))
def test_both_ways_round_and_on_corners_most(length: float, width: float, radius: float) -> None:
    on_corners = lever(corners(length, width), radius)
    assert lever(corners(length, width), -radius) == pytest.approx(-on_corners)
    assert lever(spread(length, width), radius) < on_corners


def test_a_block_that_turns_on_the_spot_asks_for_any_lever() -> None:
    """No force, but a torque."""
    assert lever(corners(0.1, 0.1), 1e-6) > 100


@given(EDGES, st.floats(0.01, 0.5))
def test_in_the_sharpest_curve_the_force_acts_at_the_end_of_the_contact(
    edge: float, share: float
) -> None:
    contact = share * edge
    radius = smallest_turning_radius(edge, edge, contact)
    assert lever(corners(edge, edge), radius) == pytest.approx(contact / 2)
    assert smallest_turning_radius(edge, edge, 0.9 * contact) > radius
