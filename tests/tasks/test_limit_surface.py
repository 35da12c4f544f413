"""The limit surface against sums over the rectangle, and limits that are known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.tasks.limit_surface import friction_radius, smallest_turning_radius

EDGES = st.floats(0.01, 1.0)


@given(EDGES, EDGES)
def test_the_friction_radius_is_the_mean_distance_from_the_centre(a: float, b: float) -> None:
    middles = (np.arange(400) + 0.5) / 400 - 0.5
    mean = np.hypot(*np.meshgrid(a * middles, b * middles)).mean()
    assert friction_radius(a, b) == pytest.approx(mean, rel=1e-4)
    assert friction_radius(a, b) == pytest.approx(friction_radius(b, a))


def test_of_a_square_and_of_a_rod() -> None:
    square = (math.sqrt(2) + math.log(1 + math.sqrt(2))) / 6
    assert friction_radius(0.1, 0.1) == pytest.approx(0.1 * square)
    assert friction_radius(1.0, 1e-9) == pytest.approx(1 / 4)


@given(EDGES, EDGES, EDGES)
def test_the_force_of_the_sharpest_curve_acts_at_the_end_of_the_contact(
    a: float, b: float, contact: float
) -> None:
    """The twist (v, v / R) is the normal of the ellipsoid f^2 + (m / c)^2 at (f, m)."""
    radius = smallest_turning_radius(a, b, contact)
    force, speed = 1.0, 1.0
    torque = force * contact / 2
    turning = speed * torque / force / friction_radius(a, b) ** 2
    assert speed / turning == pytest.approx(radius)
