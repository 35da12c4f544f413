"""How many repetitions a claim needs: laws, known values, and simulated power."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import ttest_ind

from pytest_simbench.measure.intervals import Interval, interval, wilson
from pytest_simbench.measure.power import (
    further_repetitions,
    repetitions_for_mean,
    repetitions_for_proportion,
    repetitions_to_detect,
)


def test_35_successes_show_90_percent() -> None:
    """n / (n + z^2) >= 0.9 gives n >= 9 z^2 = 34.6."""
    assert repetitions_for_proportion(1.0, 0.9) == 35
    assert further_repetitions(wilson(20, 20), 0.9) == 15


@settings(max_examples=40)
@given(st.floats(0.0, 1.0), st.floats(0.05, 0.95))
def test_the_repetitions_for_a_proportion_are_enough(rate: float, threshold: float) -> None:
    n = repetitions_for_proportion(rate, threshold)
    if n is None:
        assert abs(rate - threshold) < 0.02
    else:
        assert threshold not in wilson(rate * n, n) or threshold == wilson(rate * n, n).low


@settings(max_examples=40)
@given(st.floats(0.02, 0.98), st.floats(0.01, 0.3))
def test_more_repetitions_are_needed_nearer_the_threshold(rate: float, gap: float) -> None:
    far = repetitions_for_proportion(rate, max(0.0, rate - 2 * gap)) or 10_001
    near = repetitions_for_proportion(rate, max(0.0, rate - gap)) or 10_001
    assert near >= far


@pytest.mark.parametrize("threshold", [0.05, 0.2, 0.9])
def test_a_decided_claim_needs_no_more(threshold: float) -> None:
    assert further_repetitions(Interval(0.5, 0.4, 0.6, 20, "bca"), threshold) == 0


def test_the_width_of_a_mean_shrinks_with_the_root_of_n() -> None:
    found = Interval(0.5, 0.25, 0.875, 20, "bca")
    assert further_repetitions(found, 0.375) == 60  # the lower arm is twice the gap: 4 n
    assert further_repetitions(found, 0.625) == 160  # the upper one thrice: 9 n
    assert further_repetitions(found, 0.5) is None
    assert further_repetitions(found, 0.5 + 1e-9) is None


def test_one_value_cannot_tell() -> None:
    assert further_repetitions(interval([1.0]), 0.5) is None
    assert further_repetitions(interval([]), 0.5) is None


def test_further_repetitions_decide_in_simulation() -> None:
    """With as many as are said to be needed, about half or more of the claims are decided."""
    rng = np.random.default_rng(3)
    first = rng.normal(1.0, 1.0, 20)
    first = (first - first.mean()) / first.std(ddof=1) + 1.0
    more = further_repetitions(interval(list(first)), 0.7)
    assert more is not None
    n = 20 + more
    lows = [interval(list(sample)).low for sample in rng.normal(1.0, 1.0, (40, n))]
    assert 0.3 <= np.mean(np.array(lows) >= 0.7) <= 0.75


def test_repetitions_for_mean_is_the_textbook_number() -> None:
    assert repetitions_for_mean(std=10, half_width=2) == 97  # (1.96 * 10 / 2)^2 = 96.04


@pytest.mark.parametrize("paired", [True, False])
def test_the_power_is_reached_in_simulation(paired: bool) -> None:
    n = repetitions_to_detect(0.10, 0.15, power=0.8, paired=paired)
    rng = np.random.default_rng(4)
    before = rng.normal(0.0, 0.15, (2000, n))
    if paired:
        from scipy.stats import ttest_1samp

        p = ttest_1samp(before + 0.10, 0.0, axis=1, alternative="greater").pvalue
    else:
        after = rng.normal(0.10, 0.15, (2000, n))
        p = ttest_ind(after, before, axis=1, alternative="greater").pvalue
    assert np.mean(p < 0.05) == pytest.approx(0.8, abs=0.06)
