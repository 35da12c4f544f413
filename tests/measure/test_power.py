"""How many repetitions a claim needs: laws, known values, and simulated power."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_simbench.measure.intervals import Interval, interval, proportion
from pytest_simbench.measure.power import (
    alike_rate,
    further_repetitions,
    least_supported,
    passing_rate,
    repetitions_for_proportion,
)
from pytest_simbench.measure.suites import stats
from pytest_simbench.records.metrics import Metric

COUNT = Metric("picks", "picks")
HIT = Metric("hit", "hit", kind="yes_no")
PLACED = Metric("placed", "placed", kind="share", of=15)


@settings(max_examples=40)
@given(st.floats(0.0, 1.0), st.floats(0.05, 0.95))
def test_the_repetitions_for_a_proportion_are_enough(rate: float, threshold: float) -> None:
    n = repetitions_for_proportion(rate, threshold)
    if n is None:
        assert abs(rate - threshold) < 0.02
    else:
        assert threshold not in proportion(rate * n, n) or threshold == proportion(rate * n, n).low


@settings(max_examples=40)
@given(st.floats(0.02, 0.98), st.floats(0.01, 0.3))
def test_more_repetitions_are_needed_nearer_the_threshold(rate: float, gap: float) -> None:
    far = repetitions_for_proportion(rate, max(0.0, rate - 2 * gap)) or 10_001
    near = repetitions_for_proportion(rate, max(0.0, rate - gap)) or 10_001
    assert near >= far


SKEWED, EVEN = Interval(0.5, 0.25, 0.875, 20, "t"), Interval(0.5, 0.4, 0.6, 20, "t")


@pytest.mark.parametrize(
    ("found", "threshold", "more"),
    [
        *((EVEN, decided, 0) for decided in (0.05, 0.2, 0.9)),
        # The width of a mean shrinks with the root of n.
        (SKEWED, 0.375, 60),  # the lower arm is twice the gap: 4 n
        (SKEWED, 0.625, 160),  # the upper one thrice: 9 n
        (replace(EVEN, n=1), 0.45, 3),  # (0.1 / 0.05)^2 - 1
        (replace(SKEWED, high=0.75, method="betting"), 0.375, 60),
        *((SKEWED, threshold, None) for threshold in (0.5, 0.5 + 1e-9)),
        # There is always one more, and never more than the most: 10 000 in all.
        (EVEN, 0.4, 1),
        (replace(EVEN, n=100), 0.49, 9900),
        (replace(EVEN, n=101), 0.49, None),
        # Where nothing is known yet, the number is not, too.
        (replace(EVEN, n=0), 0.5, None),
        *((interval([1.0] * n, COUNT), 0.5, None) for n in (0, 1)),
        (interval([1.0, 2.0, 3.0], COUNT), 2.0, None),
    ],
)
def test_how_many_more_repetitions_decide(
    found: Interval, threshold: float, more: int | None
) -> None:
    assert further_repetitions(found, threshold) == more


def test_further_repetitions_decide_in_simulation() -> None:
    """With as many as are said to be needed, about half or more of the claims are decided."""
    rng = np.random.default_rng(3)
    first = rng.normal(1.0, 1.0, 20)
    first = (first - first.mean()) / first.std(ddof=1) + 1.0
    more = further_repetitions(interval(list(first), COUNT), 0.7)
    n = 20 + more
    lows = [interval(list(sample), COUNT).low for sample in rng.normal(1.0, 1.0, (40, n))]
    assert 0.3 <= np.mean(np.array(lows) >= 0.7) <= 0.75


def test_shares_without_a_loss_gain_with_their_number() -> None:
    """Their interval is 0.3 m^-n = 40 wide or so: 1 / n, where that of a spread is its root."""
    perfect = interval([1.0] * 20, PLACED)
    more = further_repetitions(perfect, 0.9)
    assert 0.89 < interval([1.0] * (20 + more), PLACED).low < 0.91


@pytest.mark.parametrize(
    ("metric", "needed"), [(HIT, [None, None, 20, 37]), (PLACED, [None, None, 20, 39])]
)
def test_what_supports_80_percent_is_the_first_count_whose_interval_lies_above(
    metric: Metric, needed: list[int | None]
) -> None:
    assert [least_supported(0.8, metric, n, 0.9) for n in (5, 10, 20, 40)] == needed
    for n, k in ((20, 20), (40, needed[3] or 0)):
        values = [1.0] * k + [0.0] * (n - k)
        assert interval(values, metric, 0.9).low >= 0.8
        assert interval([0.0, *values[1:]], metric, 0.9).low < 0.8


@pytest.mark.parametrize("metric", [HIT, PLACED], ids=["yes_no", "share"])
@pytest.mark.parametrize("chance", [0.5, 0.05])
def test_the_passing_rate_passes_that_often_in_simulation(metric: Metric, chance: float) -> None:
    rate = passing_rate(0.8, metric, 20, chance, 0.9)
    high = [interval([1.0] * k + [0.0] * (20 - k), metric, 0.9).high for k in range(21)]
    successes = np.random.default_rng(9).binomial(20, rate, 20_000)
    passed = np.mean([high[k] >= 0.8 for k in successes])
    assert passed == pytest.approx(chance, abs=0.012)


def test_what_cannot_be_refuted_passes_at_any_rate() -> None:
    """Of 5 repetitions without one success a rate of 45 % is still possible."""
    assert passing_rate(0.2, HIT, 5, 0.05, 0.9) == 0.0
    assert passing_rate(0.5, HIT, 5, 0.05, 0.9) > 0.0


def test_repetitions_that_are_all_alike_are_refuted_below_their_rate() -> None:
    rate = alike_rate(0.8, PLACED, 20, 0.9)
    assert interval([rate - 0.002] * 20, PLACED, 0.9).high < 0.8
    assert interval([rate + 0.002] * 20, PLACED, 0.9).high >= 0.8


def test_the_table_of_the_docs_is_what_is_printed(
    capsys: pytest.CaptureFixture[str], pytestconfig: pytest.Config
) -> None:
    assert stats() == 0
    lines = capsys.readouterr().out.splitlines()
    page = (pytestconfig.rootpath / "docs" / "gate.md").read_text()
    assert "\n".join(x for x in lines if not re.search(r"\| (5|80) \|", x)) in page
    assert lines[2] == "| crashed at most 15 % | 5 | none | 50 % | 81 % |  |"
    assert lines[-1] == "| `moved` at least 20 % | 80 | 29 of 80 | 8 % | 4 % | below 16 % |"
    assert len(lines) == 2 + 4 * 3


def test_further_repetitions_are_counted_at_the_interval_s_own_confidence() -> None:
    """0.025^(1 / n) >= 0.9 gives n >= 35.01, 36 repetitions at 95 %; 29 at 90 %, 44 at 98 %."""
    for confidence, total in ((0.9, 29), (0.95, 36), (0.98, 44)):
        assert further_repetitions(proportion(20, 20, confidence), 0.9) == total - 20
        assert repetitions_for_proportion(1.0, 0.9, confidence) == total
        assert repetitions_for_proportion(0.0, 0.1, confidence) == total
    assert repetitions_for_proportion(1.0, 0.9) == 36
    for rate, threshold in ((1.0, 0.02), (0.0, 0.98)):  # the fewest is one
        assert repetitions_for_proportion(rate, threshold) == 1
