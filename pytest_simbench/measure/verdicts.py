"""Claims about a metric, and what the repetitions say of them.

A claim has one side, so a verdict can be wrong in one way only: a claim that is true is refuted, or
one that is false supported. Each happens in at most `ERROR` of all runs, because a claim is judged
by the ends of an interval each of which misses the truth so rarely.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

from pytest_simbench.measure.intervals import CONFIDENCE, FEWEST, Interval
from pytest_simbench.measure.power import further_repetitions
from pytest_simbench.records.metrics import Metric

ERROR = 1 - CONFIDENCE
"""Probability that a verdict is wrong, at most."""


class Verdict(StrEnum):
    """What the data say of a claim."""

    SUPPORTED = "supported"
    REFUTED = "refuted"
    INCONCLUSIVE = "inconclusive"
    NOT_JUDGED = "not judged"
    """Fewer than `FEWEST` repetitions."""

    @property
    def decided(self) -> bool:
        return self in (Verdict.SUPPORTED, Verdict.REFUTED)


@dataclass(frozen=True)
class Bound:
    """The true mean is at least, or at most, a value."""

    relation: Literal["at least", "at most"]
    value: float

    def __str__(self) -> str:
        return f"{self.relation} {self.value:g}"


def at_least(value: float) -> Bound:
    """The claim that the true mean is `value` or more."""
    return Bound("at least", value)


def at_most(value: float) -> Bound:
    """The claim that the true mean is `value` or less."""
    return Bound("at most", value)


def confidence(metric: Metric, error: float = ERROR) -> float:
    """Of the interval whose ends each err in at most `error` of all runs.

    Those of a proportion share the error of their interval evenly; those of a skewed value do not,
    so that each may take all of it.
    """
    return 1 - (2 * error if metric.bounded else error)


@dataclass(frozen=True)
class Judgement:
    """A verdict on a claim.

    Attributes:
        further: when undecided, about how many more repetitions would decide; None when more
            than any run could have (the mean is at the threshold) or too few are there to tell.
        sole: whether the test is asked once, as others would be the same: its costs alone differ.
    """

    verdict: Verdict
    claim: Bound
    interval: Interval
    further: int | None = 0
    sole: bool = False

    @property
    def advice(self) -> str:
        """What to do about a claim that is not decided, for messages; empty when it is."""
        if self.verdict.decided:
            return ""
        if self.verdict is Verdict.NOT_JUDGED:
            if self.sole:
                return "it is asked once, which is too few for a claim about a cost"
            return f"a claim needs {FEWEST} repetitions or more"
        if self.further is not None:
            return f"about {self.further} more repetition{'s' * (self.further != 1)} needed"
        if self.claim.value in (0, 1) and self.claim.value == self.interval.mean:
            low = self.claim.relation == "at least"
            shown = self.interval.low if low else self.interval.high
            return (
                f"all {self.interval.n} repetitions are at the threshold, which no number of them "
                f"proves; these prove {self.claim.relation} {shown:.3g}"
            )
        return "the mean is too close to the threshold for any number of repetitions"


def judge(claim: Bound, interval: Interval) -> Judgement:
    """Supported when the whole interval fulfils the claim, refuted when none of it does.

    A value that was the same in all repetitions is judged as it is.
    """
    if interval.n < FEWEST and interval.method != "constant":
        return Judgement(Verdict.NOT_JUDGED, claim, interval, None)
    low, high, value = interval.low, interval.high, claim.value
    if interval.method == "constant":
        low = high = interval.mean
    if claim.relation == "at least":
        supported, refuted = low >= value, high < value
    else:
        supported, refuted = high <= value, low > value
    if supported:
        return Judgement(Verdict.SUPPORTED, claim, interval)
    if refuted:
        return Judgement(Verdict.REFUTED, claim, interval)
    return Judgement(Verdict.INCONCLUSIVE, claim, interval, further_repetitions(interval, value))
