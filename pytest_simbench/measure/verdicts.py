"""Claims about a metric, and what the repetitions say of them: supported, refuted, inconclusive."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

from pytest_simbench.measure.intervals import Interval
from pytest_simbench.measure.power import further_repetitions


class Verdict(StrEnum):
    """What the data say of a claim."""

    SUPPORTED = "supported"
    REFUTED = "refuted"
    INCONCLUSIVE = "inconclusive"


@dataclass(frozen=True)
class Claim:
    """The true mean is at least, or at most, a value."""

    relation: Literal["at least", "at most"]
    value: float

    def __str__(self) -> str:
        return f"{self.relation} {self.value:g}"


def at_least(value: float) -> Claim:
    """The claim that the true mean is `value` or more."""
    return Claim("at least", value)


def at_most(value: float) -> Claim:
    """The claim that the true mean is `value` or less."""
    return Claim("at most", value)


@dataclass(frozen=True)
class Judgement:
    """A verdict on a claim.

    Attributes:
        further: when inconclusive, about how many more repetitions would decide; None when more
            than any run could have (the mean is at the threshold) or too few are there to tell.
    """

    verdict: Verdict
    claim: Claim
    interval: Interval
    further: int | None = 0

    @property
    def advice(self) -> str:
        """What to do about an inconclusive verdict, for messages; empty when decided."""
        if self.verdict is not Verdict.INCONCLUSIVE:
            return ""
        if self.further is not None:
            return f"about {self.further} more repetitions needed"
        if self.interval.n < 2:
            return "too few repetitions to tell how many more are needed"
        return "the mean is too close to the threshold for any number of repetitions"


def judge(claim: Claim, interval: Interval) -> Judgement:
    """Supported when the whole interval fulfils the claim, refuted when none of it does."""
    low, high, value = interval.low, interval.high, claim.value
    if claim.relation == "at least":
        supported, refuted = low >= value, high < value
    else:
        supported, refuted = high <= value, low > value
    if supported:
        return Judgement(Verdict.SUPPORTED, claim, interval)
    if refuted:
        return Judgement(Verdict.REFUTED, claim, interval)
    return Judgement(Verdict.INCONCLUSIVE, claim, interval, further_repetitions(interval, value))
