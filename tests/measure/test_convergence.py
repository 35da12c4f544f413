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


SINGLE = [1e-5, 2.5e-6, 6e-7, 1.7e-7, 3e-7, 5e-7]
"""Of a second order in single precision: it falls to 1e-7, and rounding grows again."""

TOP = [1.286e-08, 8.033e-10, 5.021e-11, 2.943e-12, 4.497e-13, 8.096e-13]
"""Of a free top in MuJoCo with its integrator RK4; the fifth step is rounding, and smaller."""


@pytest.mark.parametrize(
    ("errors", "rounding", "points", "order", "off"),
    [
        (SINGLE, 5e-7, 4, 2, 0.15),  # the fourth lies below the level, and still goes on falling
        (SINGLE, 0.0, 6, 1, 0.2),
        ([h**3 for h in STEPS], 1e-6, 6, 3, 1e-9),  # double precision, where single is allowed for
        (TOP, 1e-4, 4, 4, 0.05),
        ([*STEPS[:5], 0.0], 0.0, 5, 1, 1e-9),
        ([0.02, 0.021, 0.0199, 0.0201, 0.02, 0.0205], 1e-6, 6, 0, 0.05),
    ],
    ids=["rounding", "not told of", "clean", "double", "a zero", "the step changes nothing"],
)
def test_what_is_rounding_is_left_out_of_the_order(
    errors: list[float], rounding: float, points: int, order: float, off: float
) -> None:
    found = convergence(STEPS, errors, rounding)
    assert (found.points, found.order) == (points, pytest.approx(order, abs=off))
    assert found.low - 1e-9 < order < found.high + 1e-9


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


def test_two_steps_give_an_order_without_an_interval() -> None:
    found = convergence(STEPS[:2], [4e-3, 1e-3])
    assert found.order == pytest.approx(2)
    assert (found.low, found.high) == (-math.inf, math.inf)
    found = convergence(STEPS[:3], [16e-3, 4e-3, 1e-3])  # of three there is one
    assert (found.low, found.high) == pytest.approx((2, 2))


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
