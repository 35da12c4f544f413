"""The repetitions of one task on one simulator in one mode, and what may be asserted of them."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from math import inf, isfinite
from typing import NoReturn

from pytest_simbench.ground.text import in_one_line
from pytest_simbench.measure.intervals import CONFIDENCE, Interval, interval
from pytest_simbench.measure.limits import LimitError, check_threshold
from pytest_simbench.measure.verdicts import (
    ERROR,
    Bound,
    Judgement,
    Verdict,
    at_least,
    at_most,
    confidence,
    judge,
)
from pytest_simbench.records.metrics import COSTS, CRASHED, Metric, UnknownMetric
from pytest_simbench.records.record import Record
from pytest_simbench.records.series import grouped


class InconclusiveWarning(UserWarning):
    """The repetitions decide a claim neither way, or are too few to be judged; the message says how
    many more are needed."""


class ResultSet:
    """Records with the metrics of their task.

    A crashed repetition counts with the worst value of a share or yes-or-no metric that has a good
    direction (`Record.value`); other metrics, and all of `--protocol paper`, are of the repetitions
    that finished. An assertion on a metric *fails* when the interval of its mean, each of whose
    ends is right in at least 95 of 100 runs, lies wholly on the wrong side of the threshold,
    *passes* when it lies wholly on the right side, and else (also with fewer than 5 repetitions)
    passes with an `InconclusiveWarning`, or fails where `strict`.

    Args:
        records: of one task, simulator, mode and profile.
        metrics: that the task declares; the costs of `metrics.COSTS` are known besides.

    Attributes:
        error: probability, at most, that a verdict on a claim is wrong.
        strict: whether a claim that is not decided fails (`--sim-strict`).
        claims_crashes: whether a claim about crashes was made, see `check_crashes`.
        warns: whether a claim that is not decided is told by a warning: not where a run tells of
            all claims together.
        judged: the claims that were made, and what came of them.
    """

    error: float = ERROR
    strict: bool = False
    claims_crashes: bool = False
    warns: bool = True

    def __init__(self, records: Iterable[Record], metrics: Iterable[Metric]) -> None:
        self.records: tuple[Record, ...] = tuple(records)
        self.metrics: dict[str, Metric] = {metric.name: metric for metric in metrics}
        self._costs = {metric.name: metric for metric in COSTS if metric.name not in self.metrics}
        self._intervals: dict[tuple[Metric, float], Interval] = {}
        self._ok: tuple[tuple[Record, ...], tuple[Record, ...]] = ((), ())
        self.judged: list[tuple[Metric, Judgement]] = []

    def __len__(self) -> int:
        return len(self.records)

    def __repr__(self) -> str:
        return f"<ResultSet {self.label}: {len(self.ok)} ok, {len(self.crashed)} crashed>"

    @property
    def label(self) -> str:
        """Task, simulator, mode and profile, as messages name them."""
        if not self.records:
            return "no repetition"
        first = self.records[0]
        return f"{first.task} on {first.label}"

    @property
    def ok(self) -> tuple[Record, ...]:
        """The repetitions that finished."""
        if self._ok[0] is not self.records:  # a sequence of looks sets longer and longer ones
            self._ok = self.records, tuple(record for record in self.records if record.ok)
        return self._ok[1]

    def sole(self, name: str | Metric) -> bool:
        """Whether a metric (no cost) is one value, which every repetition there could be would
        have."""
        drawn = self.metric(name) in COSTS or not all(record.notes.sole for record in self.records)
        return not drawn and len({*self.values(name)}) == 1

    @property
    def crashed(self) -> tuple[Record, ...]:
        """The repetitions that crashed; each has its `error`."""
        return tuple(record for record in self.records if record.status == "failed")

    failures = crashed

    @property
    def interrupted(self) -> tuple[Record, ...]:
        """The repetitions that the user ended; they neither finished nor crashed."""
        return tuple(record for record in self.records if record.status == "interrupted")

    def causes(self) -> dict[str, list[Record]]:
        """The crashes by cause (`WorkerHung in settle`), the most frequent first."""
        found = grouped(self.crashed, lambda r: r.error.cause if r.error else "unknown cause")
        return dict(sorted(found.items(), key=lambda item: -len(item[1])))

    @property
    def known(self) -> tuple[str, ...]:
        """Names of the metrics and costs that can be asked for."""
        return (*self.metrics, *self._costs)

    def metric(self, name: str | Metric) -> Metric:
        """The metric (or cost) of that name; also one that is given itself, as `CRASHED`.

        Raises:
            UnknownMetric: there is none; the message lists the valid names.
        """
        if isinstance(name, Metric):
            return name
        found = self.metrics.get(name) or self._costs.get(name)
        if found is None:
            where = f" in {self.label}" if self.records else ""
            raise UnknownMetric(name, self.known, where)
        return found

    def value(self, record: Record, name: str | Metric) -> float | None:
        """What a record counts with at a metric; None where it has no value. A crashed one has none
        of what the finished ones lack: other tests of the task measure it."""
        metric = self.metric(name)
        found = record.value(metric)
        if not record.ok and self.ok and metric.name in self.metrics:
            found = found if any(metric.name in ended.metrics for ended in self.ok) else None
        return None if found is None else float(found)

    def values(self, name: str | Metric) -> list[float]:
        """A metric's values, one for each repetition that has one, in their order."""
        return [found for record in self.records if (found := self.value(record, name)) is not None]

    def without(self, name: str | Metric) -> int:
        """How many repetitions finished and have no value of a metric."""
        return sum(self.value(record, name) is None for record in self.ok)

    def by_seed(self, name: str | Metric) -> dict[int, float]:
        """A metric's values by seed, for pairing with another set."""
        found = ((record.seed, self.value(record, name)) for record in self.records)
        return {seed: value for seed, value in found if value is not None}

    def interval(self, name: str | Metric, confidence: float = CONFIDENCE) -> Interval:
        """The interval of a metric's mean; without values its mean is nan and n is 0, and without
        bounds where it is one value."""
        key = (self.metric(name), confidence)
        if key not in self._intervals:
            found = interval(self.values(name), *key)
            if self.sole(name):
                found = replace(found, low=-inf, high=inf, method="constant")
            self._intervals[key] = found
        return self._intervals[key]

    def judge(self, name: str | Metric, claim: Bound) -> Judgement:
        """What the repetitions say of a claim about a metric's true mean."""
        metric = self.metric(name)
        found = self._decide(claim, lambda: self._judged(metric, claim))
        return replace(found, sole=bool(self.records) and all(r.notes.sole for r in self.records))

    def _judged(self, metric: Metric, claim: Bound) -> Interval:
        """The interval by which a claim about a metric, or about crashes, is judged: of those that
        finished, where a crash would speak for it."""
        level = confidence(metric, self.error)
        if not self._favoured(metric, claim):
            return self.interval(metric, level)
        return interval(
            [v for r in self.ok if (v := self.value(r, metric)) is not None], metric, level
        )

    def _favoured(self, metric: Metric, claim: Bound) -> bool:
        """Whether what a crashed repetition counts with speaks for the claim."""
        favours = {0.0: "at most", 1.0: "at least", None: ""}[metric.crashed]
        return (
            bool(self.ok and self.crashed) and metric is not CRASHED and claim.relation == favours
        )

    def _decide(self, claim: Bound, interval: Callable[[], Interval]) -> Judgement:
        return judge(claim, interval())

    def assert_at_least(self, name: str, threshold: float) -> None:
        """Fail when the true mean is below `threshold`; shares are in 0..1.

        Raises:
            LimitError: a threshold that the metric cannot reach, or cannot miss; so do the other
                assertions.
        """
        __tracebackhide__ = True
        self._assert(self.metric(name), at_least(threshold))

    def assert_at_most(self, name: str, threshold: float) -> None:
        """Fail when the true mean is above `threshold`; shares are in 0..1."""
        __tracebackhide__ = True
        self._assert(self.metric(name), at_most(threshold))

    def assert_between(self, name: str, low: float, high: float) -> None:
        """Fail when the true mean is outside `low`..`high`; shares are in 0..1."""
        __tracebackhide__ = True
        metric = self.metric(name)
        for value in (low, high):
            check_threshold(metric, value)
        if low > high:
            raise ValueError(f"{name} cannot lie between {low:g} and {high:g}: low is above high")
        self._assert(metric, at_least(low), at_most(high))

    def assert_no_crashes(self) -> None:
        """Fail when a repetition crashed, or when none was recorded."""
        __tracebackhide__ = True
        self.claims_crashes = True
        self._assert_recorded()
        if self.crashed:
            self._refute("")
        found = Judgement(Verdict.SUPPORTED, at_most(0.0), self._judged(CRASHED, at_most(0.0)))
        self.judged.append((CRASHED, found))

    def assert_crashed_at_most(self, share: float) -> None:
        """Fail when more than `share` (0..1) of all repetitions ever made would crash."""
        __tracebackhide__ = True
        self.claims_crashes = True
        self._assert(CRASHED, at_most(share))

    assert_no_failures, assert_failures_at_most = assert_no_crashes, assert_crashed_at_most

    def check_crashes(self, share: float) -> None:
        """Fail when no repetition finished, or as `assert_crashed_at_most` where some crashed.

        Of a share of 0 one crash is enough, whatever the number of repetitions. What the test
        itself claimed of crashes counts in place of `share`. A share of 1 allows everything.
        """
        __tracebackhide__ = True
        if share >= 1 or not self.crashed:
            return
        if not self.ok:
            self._refute(". No repetition finished")
        if self.claims_crashes:
            return
        if not share:
            self._refute(". None may crash (--sim-crashes)")
        self.assert_crashed_at_most(share)

    def _refute(self, why: str) -> NoReturn:
        """Fail for crashes of which there may be none: one is enough."""
        __tracebackhide__ = True
        found = Judgement(Verdict.REFUTED, at_most(0.0), self._judged(CRASHED, at_most(0.0)))
        self.judged.append((CRASHED, found))
        raise AssertionError(f"{self._crashes()}{why}")

    def _assert(self, metric: Metric, *claims: Bound) -> None:
        __tracebackhide__ = True
        for claim in claims:
            check_threshold(metric, claim.value)
        vain = all(claim.value == (claim.relation == "at most") for claim in claims)
        if vain and metric.bounded and metric is not CRASHED:
            told = f"{claims[0].relation} {metric.format(claims[0].value)}"
            raise LimitError(f"{metric.name} is always {told}: this claim can never fail")
        self._assert_recorded()
        if not self.ok and metric is not CRASHED:
            raise AssertionError(f"{metric.name} cannot be judged: {self._crashes()}")
        if self.ok and all(self.value(record, metric) is None for record in self.ok):
            raise AssertionError(
                f"{self.label}: {metric.name} is not available in any of the {len(self.ok)} "
                "repetitions that finished"
            )
        found = [self.judge(metric, claim) for claim in claims]
        self.judged += [(metric, judgement) for judgement in found]
        for judgement in found:
            if judgement.verdict is Verdict.REFUTED:
                wrong = "below" if judgement.claim.relation == "at least" else "above"
                limit = metric.format(judgement.claim.value)
                told = self._measured(metric, judgement.claim)
                raise AssertionError(f"{told}, which is {wrong} {limit}")
        for judgement in found:
            if not judgement.verdict.decided:
                asked = f"{judgement.claim.relation} {metric.format(judgement.claim.value)}"
                told = f"{judgement.verdict} whether {asked}, {judgement.advice}"
                text = f"{self._measured(metric, judgement.claim)}: {told}"
                if self.strict:
                    raise AssertionError(f"{text} (--sim-strict)")
                if self.warns:
                    warnings.warn(text, InconclusiveWarning, stacklevel=3)

    def _assert_recorded(self) -> None:
        __tracebackhide__ = True
        if len(self.interrupted) == len(self.records):
            raise AssertionError(f"{self.label}: no repetition has ended, nothing can be judged")

    def _bounds(self, metric: Metric, found: Interval) -> str:
        """The interval by which a claim was judged, in words."""
        if found.method == "constant":
            return "the same in all repetitions"
        level = f"{100 * (1 - self.error):.4g} %"
        if not isfinite(found.high - found.low):
            return f"no {level} bounds yet"
        return f"{level} bounds {metric.format(found.low)} and {metric.format(found.high)}"

    def _measured(self, metric: Metric, claim: Bound) -> str:
        """What was measured, with simulator, mode, profile, bounds and number of repetitions."""
        found, crashed = self._judged(metric, claim), len(self.crashed)
        if metric is CRASHED:
            return f"{self._crashes()} ({self._bounds(metric, found)})"
        number = f"{found.n} repetition{'s' if found.n > 1 else ''}"
        counts = crashed and self.value(self.crashed[0], metric) is not None
        if counts and not self._favoured(metric, claim):
            number += f", {crashed} crashed and counted as {metric.format(metric.crashed or 0.0)}"
        elif crashed:
            number += f" that finished, {crashed} crashed"
            paper = metric.crashed is not None and not counts
            number += ", not counted by --protocol paper" if paper else ""
        if without := self.without(metric):
            number += f", {without} without a value"
        return (
            f"{self.label}: {metric.name} is {metric.format(found.mean)} on average "
            f"({self._bounds(metric, found)}, {number})"
        )

    def _crashes(self) -> str:
        """How many crashed and why, the most frequent cause first, with its first message."""
        total = len(self.ok) + len(self.crashed)
        text = f"{self.label}: {len(self.crashed)} of {total} repetitions crashed"
        reasons = [
            f"{len(records)} x {cause}{_example(records)}"
            for cause, records in self.causes().items()
        ]
        return text + (f": {'; '.join(reasons)}" if reasons else "")


def _example(records: Sequence[Record]) -> str:
    first = records[0]
    message = in_one_line(first.error.message) if first.error else ""
    place = f"repetition {first.repetition}, seed {first.seed}"
    return f" ({place}: {message})" if message else f" ({place})"
