"""Intervals: known values, laws, and how often they hold the truth in simulated experiments."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.stats import binom, norm, t

from pytest_simbench.measure.intervals import (
    Interval,
    bootstrap,
    expanded_level,
    interquartile_interval,
    interquartile_mean,
    interval,
    wilson,
)

shares = st.lists(st.integers(0, 15).map(lambda k: k / 15), min_size=1, max_size=30)
finite = st.floats(-1e6, 1e6)


def test_twenty_of_twenty_proves_only_84_percent() -> None:
    found = wilson(20, 20)
    assert (round(found.low, 2), found.high) == (0.84, 1.0)


def test_wilson_agrees_with_a_published_value() -> None:
    """81 of 263: 0.2553 to 0.3662 (Newcombe 1998, Statistics in Medicine 17, table I, method 3)."""
    found = wilson(81, 263)
    assert (round(found.low, 4), round(found.high, 4)) == (0.2553, 0.3662)


@pytest.mark.parametrize("n", [5, 20, 60])
def test_wilson_covers_the_truth(n: int) -> None:
    """Exact mean coverage over all proportions, from the binomial distribution itself."""
    rates = np.linspace(0.02, 0.98, 49)
    ends = [wilson(k, n) for k in range(n + 1)]
    low = np.array([found.low for found in ends])
    high = np.array([found.high for found in ends])
    holds = (low <= rates[:, None]) & (rates[:, None] <= high)
    coverage = (binom.pmf(np.arange(n + 1), n, rates[:, None]) * holds).sum(axis=1)
    assert coverage.mean() == pytest.approx(0.95, abs=0.015)
    assert coverage.min() > 0.83  # Wilson's known dips at small n


@given(st.integers(1, 200), st.data())
def test_wilson_is_symmetric_and_holds_its_proportion(n: int, data: st.DataObject) -> None:
    k = data.draw(st.integers(0, n))
    found, mirrored = wilson(k, n), wilson(n - k, n)
    assert 0 <= found.low <= k / n <= found.high <= 1
    assert found.low == pytest.approx(1 - mirrored.high, abs=1e-9)


@given(st.integers(1, 50), st.floats(0, 1))
def test_wilson_of_a_fraction_is_rounded_outwards(n: int, rate: float) -> None:
    found = wilson(rate * n, n)
    count = round(rate * n, 9)  # 2.9999999999999996 is 3
    below, above = wilson(math.floor(count), n), wilson(math.ceil(count), n)
    assert (found.low, found.high) == (below.low, above.high)


@pytest.mark.parametrize(("successes", "n"), [(3, 2), (-1, 5), (0, 0)])
def test_wilson_refuses_what_is_no_proportion(successes: int, n: int) -> None:
    with pytest.raises(ValueError, match="0 <= successes <= n"):
        wilson(successes, n)


Draw = Callable[[np.random.Generator, int], NDArray[np.float64]]


@pytest.mark.parametrize(
    ("draw", "truth", "n", "least"),
    [
        pytest.param(lambda r, n: r.normal(2, 3, n), 2.0, 20, 0.95, id="normal"),
        pytest.param(lambda r, n: r.normal(2, 3, n), 2.0, 5, 0.91, id="normal, few"),
        pytest.param(lambda r, n: r.exponential(1, n), 1.0, 20, 0.94, id="exponential"),
        pytest.param(lambda r, n: r.binomial(15, 0.9, n) / 15, 0.9, 20, 0.95, id="shares"),
        pytest.param(lambda r, n: r.binomial(15, 0.98, n) / 15, 0.98, 20, 0.97, id="high shares"),
        pytest.param(lambda r, n: r.binomial(15, 0.98, n) / 15, 0.98, 5, 0.97, id="high, few"),
        pytest.param(lambda r, n: r.binomial(1, 0.8, n) * 1.0, 0.8, 20, 0.95, id="yes-no"),
    ],
)
def test_the_interval_of_a_mean_covers_the_truth(
    draw: Draw, truth: float, n: int, least: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """400 experiments each; `least` was measured with 1000, and two standard errors are allowed."""
    monkeypatch.setattr("pytest_simbench.measure.intervals.RESAMPLES", 499)
    rng = np.random.default_rng(1)
    samples = [draw(rng, n) for _ in range(400)]
    bounded = all(sample.min() >= 0 and sample.max() <= 1 for sample in samples)
    held = sum(truth in interval(list(sample), bounded=bounded) for sample in samples)
    assert held / 400 >= least - 2 * (least * (1 - least) / 400) ** 0.5


@given(st.lists(st.floats(-100, 100), min_size=3, max_size=30), st.floats(0.5, 0.99))
def test_the_expanded_level_is_as_wide_as_students_t(values: list[float], level: float) -> None:
    """The spread of bootstrap means is std / sqrt(n) with ddof 0; Student's interval has ddof 1."""
    n = len(values)
    student = t.ppf((1 + level) / 2, n - 1) * np.std(values, ddof=1) / n**0.5
    normal = norm.ppf((1 + expanded_level(level, n)) / 2) * np.std(values) / n**0.5
    assert normal == pytest.approx(student, rel=1e-3)


def test_the_interval_of_the_interquartile_mean_covers_the_truth() -> None:
    rng = np.random.default_rng(2)
    held = sum(
        0.0 in bootstrap(sample, interquartile_mean, resamples=999)
        for sample in rng.standard_t(3, (300, 20))
    )
    assert 0.89 <= held / 300 <= 0.99


def test_the_interquartile_mean_ignores_one_lost_repetition() -> None:
    values = [0.9] * 10 + [0.95] * 9
    assert interquartile_mean([*values, 0.0]) == pytest.approx(interquartile_mean([*values, 0.9]))
    found = interquartile_interval([*values, 0.0])
    assert 0.9 <= found.low <= found.mean <= found.high <= 0.95


@given(shares)
def test_shares_give_an_interval_within_0_and_1_that_holds_the_mean(values: list[float]) -> None:
    found = interval(values, bounded=True)
    assert -1e-12 <= found.low <= found.mean + 1e-12
    assert found.mean <= found.high + 1e-12 <= 1 + 2e-12
    assert found.mean == pytest.approx(np.mean(values))
    assert found.n == len(values)
    assert found.degenerate == (len(set(values)) == 1)


@given(st.lists(finite, min_size=2, max_size=12), st.floats(-1e3, 1e3))
def test_a_shift_of_the_values_shifts_the_interval(values: list[float], shift: float) -> None:
    near = max(map(abs, values)) * 1e-6 + 1e-3
    found, moved = bootstrap(values, resamples=200), bootstrap(np.add(values, shift), resamples=200)
    if found.method == moved.method:
        assert moved.mean == pytest.approx(found.mean + shift, abs=near)


def test_the_same_values_give_the_same_interval() -> None:
    values = [0.1, 0.4, 0.3, 0.9]
    assert interval(values) == interval(values)


def test_equal_shares_are_as_sure_as_their_number() -> None:
    found = interval([1.0] * 20, bounded=True)
    assert (round(found.low, 2), found.high, found.degenerate) == (0.84, 1.0, True)
    half = interval([0.5] * 20, bounded=True)
    assert (round(half.low, 2), round(half.high, 2)) == (0.30, 0.70)


def test_equal_values_are_a_point_and_marked() -> None:
    assert interval([1.5] * 4) == Interval(1.5, 1.5, 1.5, 4, "constant", True)


def test_one_value_or_none_says_nothing_of_the_mean() -> None:
    assert interval([2.0]) == Interval(2.0, -math.inf, math.inf, 1, "none", True)
    nothing = interval([], bounded=True)
    assert math.isnan(nothing.mean)
    assert nothing.n == 0
    assert nothing.to_wire()["low"] is None


def test_values_that_cannot_be_are_refused() -> None:
    with pytest.raises(ValueError, match=r"shares lie in 0..1, not 0.5..1.2"):
        interval([0.5, 1.2], bounded=True)
    with pytest.raises(ValueError, match="must be finite"):
        interval([0.5, math.nan])


def test_two_values_give_an_interval() -> None:
    found = interval([1.0, 2.0])
    assert found.low <= 1.5 <= found.high
    assert math.isfinite(found.low)
    assert 1.5 in found
    assert found.half_width > 0
