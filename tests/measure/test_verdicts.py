"""Verdicts from intervals."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.measure.intervals import Interval, interval
from pytest_simbench.measure.verdicts import Verdict, at_least, at_most, judge


def between(low: float, high: float) -> Interval:
    return Interval((low + high) / 2, low, high, 20, "bca")


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
    assert judge(claim, between(0.8, 0.9)).verdict is verdict  # type: ignore[arg-type]


@given(st.floats(-1, 2), st.floats(0, 1), st.floats(0, 1))
def test_at_least_and_at_most_mirror_each_other(value: float, a: float, b: float) -> None:
    low, high = sorted((a, b))
    mirrored = Interval(-(low + high) / 2, -high, -low, 20, "bca")
    found = judge(at_least(value), between(low, high))
    assert found.verdict is judge(at_most(-value), mirrored).verdict
    assert (found.verdict is Verdict.INCONCLUSIVE) == bool(found.advice)


def test_the_advice_says_how_many_more() -> None:
    found = judge(at_least(0.9), interval([1.0] * 20, bounded=True))
    assert found.verdict is Verdict.INCONCLUSIVE
    assert found.advice == "about 15 more repetitions needed"


def test_the_advice_admits_what_no_number_decides() -> None:
    assert "too close" in judge(at_least(0.85), between(0.8, 0.9)).advice
    assert "too few repetitions" in judge(at_least(0.85), interval([0.9])).advice


def test_a_deterministic_value_decides_at_once() -> None:
    assert judge(at_most(0.02), interval([0.01] * 3)).verdict is Verdict.SUPPORTED
