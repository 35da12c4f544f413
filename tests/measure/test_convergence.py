"""The order of convergence: planted orders, rounding, noise, and too few points."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from pytest_simbench.measure.convergence import convergence

STEPS = [0.004 / 2**k for k in range(6)]


@pytest.mark.parametrize("order", [1, 2, 4])
def test_a_planted_order_is_found(order: int) -> None:
    found = convergence(STEPS, [3.0 * h**order for h in STEPS])
    assert found.kind == "order"
    assert found.points == 6
    assert (found.low, found.order, found.high) == pytest.approx((order,) * 3)


@given(st.floats(0.5, 6), st.floats(1e-3, 1e3), st.permutations(range(6)), st.floats(1e-3, 1e3))
def test_neither_unit_nor_sequence_nor_the_unit_of_time_matters(
    order: float, scale: float, places: list[int], time: float
) -> None:
    wobble = [1 + 0.1 * (-1) ** k for k in range(6)]
    plain = convergence(STEPS, [h**order * w for h, w in zip(STEPS, wobble, strict=True)])
    steps = [time * STEPS[k] for k in places]
    errors = [scale * STEPS[k] ** order * wobble[k] for k in places]
    found = convergence(steps, errors)
    assert found.order == pytest.approx(plain.order, abs=1e-6)
    assert (found.low, found.high) == pytest.approx((plain.low, plain.high), abs=1e-6)
    assert found.low <= found.order <= found.high


def test_a_floor_of_rounding_is_left_out() -> None:
    """Single precision: the error of a second order falls to 1e-7, and rounding grows again."""
    errors = [1e-5, 2.5e-6, 6e-7, 1.7e-7, 3e-7, 5e-7]
    found = convergence(STEPS, errors, rounding=5e-7)
    assert found.points == 4  # the fourth lies below the level, and still goes on falling
    assert found.order == pytest.approx(2, abs=0.15)
    assert convergence(STEPS, errors).order < 1.2


def test_a_clean_fall_below_rounding_is_an_order() -> None:
    """An engine that computes in double precision, where single precision is allowed for."""
    found = convergence(STEPS, [h**3 for h in STEPS], rounding=1e-6)
    assert found.order == pytest.approx(3)


def test_a_floor_of_double_precision_is_left_out_where_single_precision_is_allowed_for() -> None:
    """A free top in MuJoCo with its integrator RK4; the fifth step is rounding, and smaller."""
    errors = [1.286e-08, 8.033e-10, 5.021e-11, 2.943e-12, 4.497e-13, 8.096e-13]
    found = convergence(STEPS, errors, rounding=1e-4)
    assert found.points == 4
    assert found.low < 4 < found.high
    assert found.order == pytest.approx(4, abs=0.05)


@pytest.mark.parametrize(
    ("errors", "rounding", "kind"),
    [
        ([0.0] * 6, 0.0, "exact"),
        ([1e-3, *[0.0] * 5], 0.0, "rounding"),
        ([1e-3, 1e-5, *[0.0] * 4], 0.0, "rounding"),
        ([3e-8, 1e-8, 2e-8, 4e-8, 1e-8, 5e-8], 1e-7, "rounding"),
        ([4e-8, 2e-8, 1e-8, 4e-8, 1e-8, 5e-8], 1e-7, "rounding"),
        ([1.0], 0.0, "unknown"),
        ([], 0.0, "unknown"),
    ],
)
def test_errors_that_have_no_order(errors: list[float], rounding: float, kind: str) -> None:
    found = convergence(STEPS[: len(errors)], errors, rounding)
    assert found.kind == kind
    assert math.isnan(found.order)


def test_a_zero_among_others_is_left_out() -> None:
    assert convergence(STEPS, [*STEPS[:5], 0.0]).order == pytest.approx(1)


def test_two_steps_give_an_order_without_an_interval() -> None:
    found = convergence(STEPS[:2], [4e-3, 1e-3])
    assert found.order == pytest.approx(2)
    assert (found.low, found.high) == (-math.inf, math.inf)


def test_an_error_that_the_step_does_not_change_has_order_zero() -> None:
    found = convergence(STEPS, [0.02, 0.021, 0.0199, 0.0201, 0.02, 0.0205], rounding=1e-6)
    assert found.low < 0 < found.high
    assert abs(found.order) < 0.05


@given(st.lists(st.floats(0, 1e3), min_size=2, max_size=6), st.floats(0, 1))
def test_whatever_the_errors_are_the_order_lies_in_its_interval(
    errors: list[float], rounding: float
) -> None:
    assume(all(e == 0 or e > 1e-200 for e in errors))
    found = convergence(STEPS[: len(errors)], errors, rounding)
    assert (found.kind == "order") == (found.points >= 2)
    assert found.kind != "order" or found.low <= found.order <= found.high


def test_the_interval_holds_the_order_under_noise() -> None:
    generator = np.random.default_rng(1)
    held = 0
    for _ in range(400):
        noise = np.exp(0.3 * generator.standard_normal(6))
        found = convergence(STEPS, list(np.array(STEPS) * noise))
        held += found.low <= 1 <= found.high
    assert 0.92 < held / 400 < 0.98


@pytest.mark.parametrize(
    ("steps", "errors"),
    [([1e-3, 1e-3], [1.0, 1.0]), ([0.0], [1.0]), ([1e-3], [-1.0]), ([1e-3], [math.nan]),
     ([1e-3, 2e-3], [1.0])],
)  # fmt: skip
def test_what_is_no_step_or_no_error_is_refused(steps: list[float], errors: list[float]) -> None:
    with pytest.raises(ValueError, match="error"):
        convergence(steps, errors)
