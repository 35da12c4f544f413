"""Intervals: known values and laws. How often they hold the truth: test_coverage.py."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import t

from pytest_simbench.measure.intervals import (
    FEWEST,
    Interval,
    betting,
    interval,
    proportion,
    skewed_t,
    varies,
)
from pytest_simbench.records.metrics import Metric

SHARE = Metric("placed", "placed", kind="share", of=15)
YES_NO = Metric("hit", "hit", kind="yes_no")
LENGTH = Metric("landing", "landing", "m")
COUNT = Metric("picks", "picks")

shares = st.lists(st.integers(0, 15).map(lambda k: k / 15), min_size=1, max_size=30)
finite = st.floats(-1e6, 1e6)


def rounded(found: Interval, digits: int = 3) -> tuple[float, float]:
    return round(found.low, digits), round(found.high, digits)


def test_proportions_agree_with_published_values() -> None:
    """81 of 263, 15 of 148, 0 of 20, 1 of 29 (Newcombe 1998, Statistics in Medicine 17, table I,
    method 5)."""
    for successes, n, low, high in (
        (81, 263, 0.2527, 0.3676),
        (15, 148, 0.0578, 0.1617),
        (0, 20, 0.0, 0.1684),
        (20, 20, 0.8316, 1.0),  # 0.025^(1 / 20)
        (1, 29, 0.0009, 0.1776),
    ):
        assert rounded(proportion(successes, n), 4) == (low, high)


@given(st.integers(1, 200), st.data())
def test_a_proportion_is_symmetric_and_holds_itself(n: int, data: st.DataObject) -> None:
    k = data.draw(st.integers(0, n))
    found, mirrored = proportion(k, n), proportion(n - k, n)
    assert 0 <= found.low <= k / n <= found.high <= 1
    assert found.low == pytest.approx(1 - mirrored.high, abs=1e-9)
    assert (found.n, found.method, found.confidence) == (n, "exact", 0.95)


@given(st.integers(1, 50), st.floats(0, 1))
def test_a_fraction_is_rounded_outwards(n: int, rate: float) -> None:
    found = proportion(rate * n, n)
    count = round(rate * n, 9)  # 2.9999999999999996 is 3
    below, above = proportion(math.floor(count), n), proportion(math.ceil(count), n)
    assert (found.low, found.high) == (below.low, above.high)


@pytest.mark.parametrize(("successes", "n"), [(3, 2), (-1, 5), (0, 0), (0.5, 0)])
def test_what_is_no_proportion_is_refused(successes: float, n: int) -> None:
    with pytest.raises(ValueError, match="0 <= successes <= n and n >= 1, not"):
        proportion(successes, n)


def capital(values: list[float], m: float) -> float:
    """What betting on values above m makes of 1: the definition, in plain words."""
    stakes = [((k + 0.5) / 30, 0.7 / 30) for k in range(30)] + [(1.0, 0.3)]
    return sum(part * math.prod(1 + stake * (x / m - 1) for x in values) for stake, part in stakes)


@given(st.lists(st.floats(0, 1), min_size=1, max_size=12), st.sampled_from([0.9, 0.95, 0.99]))
def test_bets_make_rich_at_the_ends_of_a_betting_interval(
    values: list[float], confidence: float
) -> None:
    found = betting(values, confidence)
    mirrored = [1 - value for value in values]
    rich = 2 / (1 - confidence)
    for end, sample in ((found.low, values), (1 - found.high, mirrored)):
        if 1e-5 < end < sum(sample) / len(sample) - 1e-5:
            assert capital(sample, end - 2e-6) >= rich * 0.999
            assert capital(sample, end + 2e-6) <= rich * 1.001


@given(shares, st.randoms())
def test_shares_give_an_interval_within_0_and_1_that_holds_the_mean(
    values: list[float], random: object
) -> None:
    found = interval(values, SHARE)
    assert 0 <= found.low <= found.mean <= found.high <= 1
    assert found.mean == pytest.approx(np.mean(values))
    assert (found.n, found.method) == (len(values), "betting")
    again = interval(sorted(values), SHARE)
    assert again.low == pytest.approx(found.low, abs=1e-5)  # the order does not matter


def test_twenty_perfect_shares_prove_80_percent_and_a_lost_cube_less() -> None:
    """The full stake makes 0.3 / m^20 of the capital: m = (0.3 / 40)^(1 / 20) = 0.783 at least."""
    perfect = interval([1.0] * 20, SHARE)
    assert rounded(perfect) == (0.8, 1.0)
    lost = interval([1.0] * 19 + [14 / 15], SHARE)
    assert lost.low < perfect.low
    assert lost.high < 1.0


def test_more_repetitions_and_less_confidence_narrow_an_interval() -> None:
    few, many = ([0.8, 0.9, 1.0] * k for k in (3, 12))
    assert interval(many, SHARE).low > interval(few, SHARE).low
    assert interval(few, SHARE, 0.8).low > interval(few, SHARE, 0.95).low
    assert interval(few, SHARE, 0.8).high < interval(few, SHARE, 0.95).high


@given(st.lists(finite, min_size=5, max_size=12), st.floats(-1e3, 1e3))
def test_a_shift_of_the_values_shifts_the_interval(values: list[float], shift: float) -> None:
    if np.ptp(values) < 1:
        return
    near = max(map(abs, values)) * 1e-6 + 1e-3
    found, moved = skewed_t(values), skewed_t(list(np.add(values, shift)))
    assert moved.mean == pytest.approx(found.mean + shift, abs=near)
    assert moved.low == pytest.approx(found.low + shift, abs=near)
    assert moved.high == pytest.approx(found.high + shift, abs=near)


@given(st.lists(finite, min_size=5, max_size=12))
def test_mirrored_values_mirror_the_interval_and_the_mean_is_within(values: list[float]) -> None:
    if np.ptp(values) < 1:
        return
    found, mirrored = skewed_t(values), skewed_t([-value for value in values])
    assert found.low <= found.mean <= found.high
    assert mirrored.low == pytest.approx(-found.high, rel=1e-6, abs=1e-6)


def test_values_without_skewness_have_students_interval() -> None:
    """Of 1 to 5 with three degrees of freedom and 0.4 of the error."""
    found = interval([1.0, 2.0, 3.0, 4.0, 5.0], COUNT)
    reach = t.ppf(1 - 0.4 * 0.05 / 2, 3) * math.sqrt(2.5 / 5)
    assert (found.mean, found.method) == (3.0, "t")
    assert rounded(found, 6) == (round(3 - reach, 6), round(3 + reach, 6))


def test_the_interval_of_skewed_values_reaches_farther_to_the_long_side() -> None:
    """By Willink's formula: G(q) = ((1 + 6 a (q - a))^(1 / 3) - 1) / (2 a)."""
    values = [1.0, 1.0, 1.0, 2.0, 6.0, 1.0]
    found, n = interval(values, COUNT), 6
    std = np.std(values, ddof=1)
    third = np.sum((np.array(values) - 2.0) ** 3) * n / ((n - 1) * (n - 2))
    a, q = third / (6 * math.sqrt(n) * std**3), t.ppf(1 - 0.01, 4)
    upper = -(np.cbrt(1 + 6 * a * (-q - a)) - 1) / (2 * a)
    assert found.high == pytest.approx(2 + upper * std / math.sqrt(n))
    assert found.low == pytest.approx(2 - q * std / math.sqrt(n))
    assert upper > q


@pytest.mark.parametrize(
    ("metric", "values", "spread"),
    [
        (LENGTH, [1.354, 1.354002, 1.353998], False),  # micrometres: the engine's rounding
        (LENGTH, [1.354, 1.3556, 1.353], True),
        (Metric("x", "x", "m", resolution=0.01), [1.354, 1.3556, 1.353], False),
        (Metric("x", "x", "m", resolution=0.0), [1.354, 1.354002, 1.354], True),
        (COUNT, [0.0, 0.0, 1.0], True),
        (COUNT, [0.1 + 0.2, 0.3, 0.3], False),
        (COUNT, [], False),
    ],
)
def test_what_varies_by_less_than_its_resolution_does_not_vary(
    metric: Metric, values: list[float], spread: bool
) -> None:
    assert varies(values, metric) is spread


def test_the_interval_of_a_count_ends_where_counts_begin() -> None:
    """One in twenty: Student and Willink say -0.08; at a mean of 4e-5 bets win 40 fold."""
    values = [0.0] * 19 + [1.0]
    count, free = Metric("picks", "picks", least=0), interval(values, COUNT)
    found = interval(values, count)
    assert free.low == pytest.approx(-0.078, abs=1e-3)
    assert found.low == pytest.approx(4.24e-5, abs=1e-6)
    assert capital([20 * x for x in values], 20 * found.low) == pytest.approx(40, rel=3e-3)
    assert (found.mean, found.high, found.method) == (free.mean, free.high, "t")


def test_the_higher_lower_end_counts() -> None:
    steady = [10.0, 11.0, 9.0, 10.0, 10.5] * 4
    count = Metric("picks", "picks", least=0)
    assert interval(steady, count) == interval(steady, COUNT)


@given(st.lists(st.integers(0, 20), min_size=5, max_size=20), st.sampled_from([1e-9, 1.0, 1e15]))
def test_a_least_value_bounds_the_interval_in_any_unit(counts: list[int], unit: float) -> None:
    values = [unit * (3 + count) for count in counts]
    found = interval(values, Metric("x", "x", least=3 * unit))
    if np.ptp(counts):
        assert 3 * unit <= found.low <= found.mean * (1 + 1e-9)


def test_values_that_do_not_vary_have_no_interval() -> None:
    for values in ([1.5] * 6, [1.5, 1.500001, 1.5, 1.5, 1.5, 1.500002]):
        found = interval(values, LENGTH)
        assert (found.low, found.high, found.method) == (-math.inf, math.inf, "constant")
        assert found.mean == pytest.approx(1.5, abs=1e-6)


def test_few_values_or_none_say_nothing_of_the_mean() -> None:
    assert interval([2.0], COUNT) == Interval(2.0, -math.inf, math.inf, 1, "none")
    few = interval([1.0, 2.0, 3.0, 4.0], COUNT)
    assert (few.method, few.mean, few.n) == ("none", 2.5, FEWEST - 1)
    nothing = interval([], SHARE, 0.9)
    assert math.isnan(nothing.mean)
    assert (nothing.n, nothing.low, nothing.high) == (0, -math.inf, math.inf)
    assert (nothing.method, nothing.confidence) == ("none", 0.9)
    assert (
        interval([1.0], COUNT, 0.8).confidence == interval([2.0] * 6, COUNT, 0.8).confidence == 0.8
    )


def test_a_yes_or_no_is_exact_and_a_part_of_one_is_a_share() -> None:
    assert interval([1.0, 0.0, 1.0], YES_NO) == proportion(2, 3)
    assert interval([1.0, 0.5, 1.0], YES_NO).method == "betting"


def test_values_that_cannot_be_are_refused() -> None:
    with pytest.raises(ValueError, match=r"shares lie in 0\.\.1, not \[0\.5, 1\.2\]"):
        interval([0.5, 1.2], SHARE)
    with pytest.raises(ValueError, match=r"shares lie in 0\.\.1, not \[-0\.1\]"):
        betting([-0.1])
    with pytest.raises(ValueError, match="must be finite"):
        interval([0.5, math.nan], COUNT)
    with pytest.raises(ValueError, match=r"^picks is at least 0, not -1$"):
        interval([0.0, -1.0], Metric("picks", "picks", least=0))


def test_an_interval_knows_its_width_and_what_lies_in_it() -> None:
    found = Interval(0.5, 0.25, 0.875, 20, "betting")
    assert found.half_width == 0.3125
    assert 0.25 in found
    assert 0.2 not in found
