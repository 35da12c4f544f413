"""Verdicts from intervals."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.measure.intervals import Interval, interval, proportion
from pytest_simbench.measure.verdicts import Verdict, at_least, at_most, confidence, judge
from pytest_simbench.records.metrics import Metric


def between(low: float, high: float) -> Interval:
    return Interval((low + high) / 2, low, high, 20, "betting")


@pytest.mark.parametrize(
    ("claim", "verdict"),
    [
        (at_least(0.79), Verdict.SUPPORTED),
        (at_least(0.80), Verdict.SUPPORTED),
        (at_least(0.85), Verdict.INCONCLUSIVE),
        (at_least(0.90), Verdict.INCONCLUSIVE),
        (at_least(0.91), Verdict.REFUTED),
        (at_most(0.79), Verdict.REFUTED),
        (at_most(0.80), Verdict.INCONCLUSIVE),
        (at_most(0.90), Verdict.SUPPORTED),
    ],
)
def test_a_claim_is_decided_by_the_whole_interval(claim: object, verdict: Verdict) -> None:
    assert judge(claim, between(0.8, 0.9)).verdict is verdict


@given(st.floats(-1, 2), st.floats(0, 1), st.floats(0, 1))
def test_at_least_and_at_most_mirror_each_other(value: float, a: float, b: float) -> None:
    low, high = sorted((a, b))
    mirrored = Interval(-(low + high) / 2, -high, -low, 20, "betting")
    found = judge(at_least(value), between(low, high))
    assert found.verdict is judge(at_most(-value), mirrored).verdict
    assert (found.verdict is Verdict.INCONCLUSIVE) == bool(found.advice)


SHARE = Metric("placed", "placed", kind="share", of=15)
LENGTH = Metric("landing_error", "landing error", "m", "lower")


def test_the_advice_says_how_many_more_or_that_no_number_decides() -> None:
    found = judge(at_least(0.9), proportion(20, 20, 0.9))
    assert found.verdict is Verdict.INCONCLUSIVE
    assert found.advice == "about 9 more repetitions needed"
    assert replace(found, further=1).advice == "about 1 more repetition needed"
    assert "too close" in judge(at_least(0.85), between(0.8, 0.9)).advice


def test_the_advice_says_what_perfect_repetitions_prove() -> None:
    assert judge(at_least(1.0), interval([1.0] * 20, SHARE)).advice == (
        "all 20 repetitions are at the threshold, which no number of them proves; these prove at "
        "least 0.8"
    )
    assert judge(at_most(0.0), proportion(0, 20, 0.9)).advice.endswith("prove at most 0.139")
    assert judge(at_least(1.0), interval([1.0] * 19 + [0.0], SHARE)).verdict is Verdict.REFUTED


@pytest.mark.parametrize("n", [0, 1, 4])
def test_fewer_than_five_repetitions_are_not_judged(n: int) -> None:
    for value in (0.0, 1.0):
        for claim in (at_least(0.5), at_most(0.5)):
            found = judge(claim, interval([value] * n, SHARE))
            assert found.verdict is Verdict.NOT_JUDGED
            assert not found.verdict.decided
            assert found.advice == "a claim needs 5 repetitions or more"
    assert judge(at_most(0.02), interval([0.01] * n, LENGTH)).verdict is Verdict.NOT_JUDGED


def test_a_value_that_never_changes_is_judged_as_it_is() -> None:
    found = interval([0.0101, 0.0101, 0.0101002, 0.0101, 0.0101], LENGTH)
    assert judge(at_most(0.02), found).verdict is Verdict.SUPPORTED
    assert judge(at_most(0.01), found).verdict is Verdict.REFUTED
    assert judge(at_least(0.02), found).verdict is Verdict.REFUTED


def test_each_end_of_the_interval_of_a_claim_may_err_in_one_of_twenty_runs() -> None:
    """Both ends of a proportion err alike; of a skewed value one end has all of the error."""
    assert confidence(SHARE) == pytest.approx(0.90)
    assert confidence(LENGTH) == pytest.approx(0.95)
    assert confidence(SHARE, 0.01) == pytest.approx(0.98)
    assert confidence(LENGTH, 0.01) == pytest.approx(0.99)


def test_a_claim_reads_as_it_is_said() -> None:
    assert str(at_least(0.8)) == "at least 0.8"
    assert str(at_most(12.0)) == "at most 12"
    for value, claim in ((1.0, at_least(0.3)), (0.0, at_most(0.7))):
        found = judge(claim, interval([value] * 5, SHARE))
        assert (found.verdict, found.claim, found.further) == (Verdict.SUPPORTED, claim, 0)
    assert judge(at_most(0.3), interval([1.0] * 5, SHARE)).verdict is Verdict.REFUTED
