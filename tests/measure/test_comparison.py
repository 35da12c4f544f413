"""Comparisons: false alarms and power in simulated experiments, corrections, equivalence."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2, chi2_contingency

from pytest_simbench.measure import comparison
from pytest_simbench.measure.comparison import (
    alike,
    compare,
    compare_by_seed,
    fewest_alike,
    holm,
    pair,
)

EXPERIMENTS = 400
SAMPLING = 2 * (0.05 * 0.95 / EXPERIMENTS) ** 0.5
"""Two standard errors of a false-alarm rate measured by that many experiments: 0.022."""


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(comparison, "PERMUTATIONS", 499)


def normal(rng: np.random.Generator, n: int) -> Any:
    return rng.normal(0, 1, n)


def skewed(rng: np.random.Generator, n: int) -> Any:
    return rng.exponential(1, n)


def tied(rng: np.random.Generator, n: int) -> Any:
    return rng.binomial(15, 0.95, n) / 15


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("draw", [normal, skewed, tied])
@pytest.mark.parametrize("paired", [True, False])
@pytest.mark.parametrize("alternative", ["two-sided", "less"])
def test_no_true_difference_alarms_in_one_of_twenty(
    draw: Callable[..., Any], paired: bool, alternative: Any
) -> None:
    """At most 5 %, and two standard errors."""
    rng = np.random.default_rng(10)
    alarms = sum(
        compare(draw(rng, 15), draw(rng, 15), paired=paired, alternative=alternative).significant()
        for _ in range(EXPERIMENTS)
    )
    assert alarms / EXPERIMENTS <= 0.05 + SAMPLING
    assert alarms > 0  # a test that never alarms would pass the line above


@pytest.mark.usefixtures("quick")
def test_paired_seeds_find_what_unpaired_ones_do_not() -> None:
    rng = np.random.default_rng(11)
    found = {True: 0, False: 0}
    for _ in range(40):
        seeds = rng.normal(0, 1, 20)  # what a seed does to both sides
        first, second = seeds + rng.normal(0, 0.2, 20), seeds + 0.2 + rng.normal(0, 0.2, 20)
        for paired in found:
            found[paired] += compare(first, second, paired=paired).significant()
    assert found[True] >= 32
    assert found[False] <= 8


@pytest.mark.parametrize("paired", [True, False])
@pytest.mark.parametrize(
    ("first", "second"),
    [
        ([0.9, 0.9, 1.0], [0.9, 0.9, 1.0]),
        ([1.0] * 20, [1.0] * 20),
        ([1.0], [2.0]),  # one repetition is never significant
        ([1.0], [2.0] * 20),
        # The means of a permuted sum differ in the last bits; that is no difference.
        ([0.1, 0.2, 0.3, 0.7, 1e-18], [1e-18, 0.7, 0.3, 0.2, 0.1]),
    ],
)
def test_what_is_no_difference(first: list[float], second: list[float], paired: bool) -> None:
    paired = paired and len(first) == len(second)
    assert compare(first, second, paired=paired).p_value == 1.0


@pytest.mark.parametrize("paired", [True, False])
def test_sides_without_spread_can_still_differ(paired: bool) -> None:
    found = compare([0.5] * 10, [0.9] * 10, paired=paired)
    assert found.significant()
    assert found.difference == pytest.approx(0.4)


def test_one_value_that_all_repetitions_would_have_leaves_nothing_to_chance() -> None:
    known = {2.0: [0, 0, 1], 0.5: [0, 1, 0], 1.0: [1, 1, 1], 1 + 1e-15: [1, 1, 1]}
    for second, expected in known.items():
        for way, p in zip(("two-sided", "greater", "less"), expected, strict=True):
            assert compare_by_seed({1: 1.0}, {1: second}, way, sole=True).p_value == p


def test_the_direction_is_that_of_second_minus_first() -> None:
    low, high = [1.0, 1.1, 1.2, 1.3, 1.4], [2.0, 2.1, 2.2, 2.3, 2.4]
    assert compare(low, high, alternative="greater").p_value == pytest.approx(1 / 252)
    assert compare(low, high, alternative="less").p_value == 1.0
    assert compare(high, low, alternative="less").significant()


@given(
    st.lists(st.floats(0, 1), min_size=2, max_size=6),
    st.lists(st.floats(0, 1), min_size=2, max_size=6),
)
def test_exchanging_the_sides_mirrors_the_comparison(
    first: list[float], second: list[float]
) -> None:
    found, mirrored = compare(first, second), compare(second, first)
    assert found.difference == -mirrored.difference
    assert found.p_value == pytest.approx(mirrored.p_value)
    assert 0 < found.p_value <= 1


def test_only_common_seeds_are_paired() -> None:
    first, second = pair({3: 0.3, 1: 0.1, 2: 0.2}, {1: 1.1, 3: 1.3, 9: 1.9})
    assert list(first) == [0.1, 0.3]
    assert list(second) == [1.1, 1.3]


NOTHING = "nothing to compare: a side has no repetitions"


@pytest.mark.parametrize(
    ("judge", "message"),
    [
        (lambda: compare([], [1.0]), NOTHING),
        (lambda: compare([1.0], []), NOTHING),
        (lambda: compare([1.0], [1.0, 2.0], paired=True),
         "pairs need as many values on each side, not 1 and 2"),
    ],
)  # fmt: skip
def test_what_cannot_be_judged_is_refused(judge: Callable[[], Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        judge()


def test_exact_p_values_of_few() -> None:
    """By counting: of 6 ways to draw two of four, of 20 ways to draw three of six, of 8 signs."""
    two = compare([1.0, 1.1], [0.0, 0.1], alternative="less")
    assert (two.p_value, two.n, two.paired) == (pytest.approx(1 / 6), (2, 2), False)
    assert (two.first, two.second, two.difference) == pytest.approx((1.05, 0.05, -1.0))
    assert compare([1.0, 1.1], [0.0, 0.1]).p_value == pytest.approx(2 / 6)
    assert compare([1.0, 1.1], [0.0, 0.1], alternative="greater").p_value == 1.0
    assert compare([1, 2, 3], [4, 5, 6], alternative="greater").p_value == pytest.approx(1 / 20)
    signs = compare([1, 2, 3], [1.5, 2.5, 3.4], alternative="greater", paired=True)
    assert (signs.p_value, signs.n, signs.paired) == (pytest.approx(1 / 8), (3, 3), True)


def test_where_seeds_are_shared() -> None:
    """Pairs where nine of ten of the smaller side's seeds are on both, and two at least."""
    side = {seed: float(seed % 3) for seed in range(20)}
    for shared, paired in ((20, True), (18, True), (17, False), (2, False)):
        other = {seed + 20 - shared: value for seed, value in side.items()}
        found = compare_by_seed(side, other)
        assert found.paired == paired
        assert found.n == ((shared, shared) if paired else (20, 20))
    assert compare_by_seed(side, {3: 1.0, 4: 2.0}).paired
    assert not compare_by_seed(side, {3: 1.0}).paired


def test_a_significant_p_value_is_at_most_alpha() -> None:
    found = compare([1, 2, 3], [4, 5, 6], alternative="greater")
    assert found.significant(found.p_value)
    assert not found.significant(found.p_value - 1e-9)


def test_holm_agrees_with_a_worked_example() -> None:
    """By hand: 0.01 x 4 = 0.04, 0.03 x 3 = 0.09 (twice: it never falls), 0.04 x 2 -> 0.09."""
    assert holm([0.01, 0.04, 0.03, 0.5]) == pytest.approx([0.04, 0.09, 0.09, 0.5])
    assert holm([]) == []


@given(st.lists(st.floats(0, 1), max_size=10))
def test_holm_keeps_the_order_and_never_lowers(p_values: list[float]) -> None:
    adjusted = holm(p_values)
    assert all(p <= a <= 1 for p, a in zip(p_values, adjusted, strict=True))
    ranks = sorted(range(len(p_values)), key=lambda k: p_values[k])
    assert [adjusted[k] for k in ranks] == sorted(adjusted)


@pytest.mark.parametrize(("n", "yes_no"), [(60, True), (90, True), (200, True), (90, False)])
def test_shares_are_alike_in_one_of_twenty_at_the_margin(n: int, yes_no: bool) -> None:
    """A t test said so in 12 to 20 of 100 where one repetition in twenty is lost."""
    rng = np.random.default_rng(15)
    lost = (rng.random((EXPERIMENTS, n)) >= 0.05).astype(float)
    claimed = sum(alike(np.ones(n), values, 0.05, yes_no=yes_no) for values in lost)
    assert claimed / EXPERIMENTS <= 0.05 + SAMPLING
    rare = np.repeat([1.0, 14 / 15], [n - 10, 10])
    assert alike(np.ones(n), rare, 0.05, yes_no=False) == (n == 200)


@pytest.mark.parametrize(
    ("yes_no", "margin", "fewest"), [(True, 0.05, 59), (True, 0.1, 29), (False, 0.05, 72)]
)
def test_alike_so_far_is_bounded_by_what_is_rare(yes_no: bool, margin: float, fewest: int) -> None:
    """Without a loss in n, a loss of everything in so many is left: 0.05^(1/n)."""
    assert fewest_alike(margin, yes_no=yes_no) == fewest
    for n in (2, fewest - 1, fewest):
        assert alike(np.ones(n), np.ones(n), margin, yes_no=yes_no) == (n == fewest)


def rare(rng: np.random.Generator, n: int) -> Any:
    return (rng.random(n) < 0.04).astype(float)


@pytest.mark.parametrize("draw", [normal, tied, rare])
@pytest.mark.parametrize("paired", [True, False])
@pytest.mark.parametrize("alternative", ["two-sided", "less"])
def test_many_values_are_judged_as_few_are(
    draw: Callable[..., Any], paired: bool, alternative: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where scipy would take too long: within what 9999 random permutations leave open."""
    rng = np.random.default_rng(8)
    first, second = draw(rng, 400), draw(rng, 400)
    second = np.where(rng.random(400) < 0.05, first + 0.4, second)
    quick = compare(first, second, paired=paired, alternative=alternative).p_value
    monkeypatch.setattr(comparison, "MANY", 10**9)
    slow = compare(first, second, paired=paired, alternative=alternative).p_value
    sides = 2 if alternative == "two-sided" else 1
    drawn = sides * (2 * slow / sides * (1 - slow / sides) / 9999) ** 0.5  # of two such draws
    assert quick == pytest.approx(slow, abs=0.003 + 4 * drawn)


def test_so_many_values_that_their_permutations_are_normal() -> None:
    """By hand, z = 60 / 30 of 900 signs; and by Mantel and Haenszel's chi-square of two shares."""
    none, signs = np.zeros(900), np.repeat([1.0, -1.0], [480, 420])
    ways: dict[Any, float] = {"two-sided": 0.0455, "greater": 0.02275, "less": 0.97725}
    found = {way: compare(none, signs, paired=True, alternative=way).p_value for way in ways}
    assert found == pytest.approx(ways, abs=1e-5)
    first, second = np.repeat([0.0, 1.0], [350, 250]), np.repeat([0.0, 1.0], [640, 560])
    table = chi2_contingency([[350, 250], [640, 560]], correction=False).statistic * 1799 / 1800
    assert compare(first, second).p_value == pytest.approx(chi2.sf(table, 1))
    assert compare(first * 0, second * 0).p_value == 1.0


def test_one_failure_in_ten_thousand_is_no_difference() -> None:
    none, one, seven = np.zeros(10_000), np.zeros(10_000), np.zeros(10_000)
    one[3] = 1.0
    seven[:7] = 1.0
    assert compare(none, one, paired=True).p_value == 1.0
    assert 0.01 < compare(none, seven, paired=True).p_value < 0.02  # 2 / 2**7, exactly


@pytest.mark.parametrize(
    ("parts", "number"), [([3.0, -3.0, 3.0], 3), ([2.0, 1.0], 25 / 17), ([0.0, 0.0], 2)]
)
def test_how_many_equal_values_carry_as_much(parts: list[float], number: float) -> None:
    """The square of the sum of squares over the sum of fourth powers."""
    assert comparison._carrying(np.array(parts)) == pytest.approx(number)
