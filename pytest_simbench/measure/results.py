"""The repetitions of one task on one simulator in one mode, and what may be asserted of them."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Sequence
from math import isfinite

from pytest_simbench.measure.intervals import CONFIDENCE, Interval, interval, proportion
from pytest_simbench.measure.limits import FAILURES, check_threshold
from pytest_simbench.measure.verdicts import (
    ERROR,
    Claim,
    Judgement,
    Verdict,
    at_least,
    at_most,
    confidence,
    judge,
)
from pytest_simbench.records.metrics import COSTS, Metric, UnknownMetric
from pytest_simbench.records.record import Record
from pytest_simbench.records.series import grouped


class InconclusiveWarning(UserWarning):
    """The repetitions decide a claim neither way, or are too few to be judged; the message says how
    many more are needed."""


class ResultSet:
    """Records with the metrics of their task.

    A failed repetition is left out of every metric, as in the reference study, and counted by
    itself. An assertion on a metric *fails* when the interval of its mean, each of whose ends is
    right in at least 95 of 100 runs, lies wholly on the wrong side of the threshold, *passes* when
    it lies wholly on the right side, and else (also with fewer than 5 repetitions) passes with an
    `InconclusiveWarning`, or fails where `strict`.

    Args:
        records: of one task, simulator, mode and profile.
        metrics: that the task declares; the costs of `metrics.COSTS` are known besides.

    Attributes:
        error: probability, at most, that a verdict on a claim is wrong.
        strict: whether a claim that is not decided fails (`--sim-strict`).
        warns: whether a claim that is not decided is told by a warning: not where a run tells of
            all claims together.
        judged: the claims that were made, and what came of them.
    """

    error: float = ERROR
    strict: bool = False
    warns: bool = True

    def __init__(self, records: Iterable[Record], metrics: Iterable[Metric]) -> None:
        self.records: tuple[Record, ...] = tuple(records)
        self.metrics: dict[str, Metric] = {metric.name: metric for metric in metrics}
        self._costs = {metric.name: metric for metric in COSTS if metric.name not in self.metrics}
        self._intervals: dict[tuple[str, float], Interval] = {}
        self._ok: tuple[tuple[Record, ...], tuple[Record, ...]] = ((), ())
        self.judged: list[tuple[Metric, Judgement]] = []

    def __len__(self) -> int:
        return len(self.records)

    def __repr__(self) -> str:
        return f"<ResultSet {self.label}: {len(self.ok)} ok, {len(self.failures)} failed>"

    @property
    def label(self) -> str:
        """Task, simulator, mode and profile, as messages name them."""
        if not self.records:
            return "no repetition"
        first = self.records[0]
        return f"{first.task} on {first.label}"

    @property
    def ok(self) -> tuple[Record, ...]:
        """The repetitions that ended as they should."""
        if self._ok[0] is not self.records:  # a sequence of looks sets longer and longer ones
            self._ok = self.records, tuple(record for record in self.records if record.ok)
        return self._ok[1]

    @property
    def failures(self) -> tuple[Record, ...]:
        """The repetitions that failed; each has its `error`."""
        return tuple(record for record in self.records if record.status == "failed")

    @property
    def interrupted(self) -> tuple[Record, ...]:
        """The repetitions that the user ended; neither ok nor failed."""
        return tuple(record for record in self.records if record.status == "interrupted")

    def causes(self) -> dict[str, list[Record]]:
        """The failures by cause (`WorkerHung in settle`), the most frequent first."""
        found = grouped(self.failures, lambda r: r.error.cause if r.error else "unknown cause")
        return dict(sorted(found.items(), key=lambda item: -len(item[1])))

    @property
    def known(self) -> tuple[str, ...]:
        """Names of the metrics and costs that can be asked for."""
        return (*self.metrics, *self._costs)

    def metric(self, name: str) -> Metric:
        """The metric (or cost) of that name.

        Raises:
            UnknownMetric: there is none; the message lists the valid names.
        """
        found = self.metrics.get(name) or self._costs.get(name)
        if found is None:
            where = f" in {self.label}" if self.records else ""
            raise UnknownMetric(name, self.known, where)
        return found

    def value(self, record: Record, name: str) -> float | None:
        """A metric's value in one record; None where it is not available."""
        found = self._reader(name)(record)
        return None if found is None else float(found)

    def values(self, name: str) -> list[float]:
        """A metric's values, one for each ok repetition that has it, in their order."""
        read = self._reader(name)
        return [float(value) for record in self.ok if (value := read(record)) is not None]

    def by_seed(self, name: str) -> dict[int, float]:
        """A metric's values by seed, for pairing with another set; ok repetitions only."""
        read = self._reader(name)
        return {r.seed: float(value) for r in self.ok if (value := read(r)) is not None}

    def failed_by_seed(self) -> dict[int, float]:
        """1 for each repetition that failed, 0 for each that did not, by seed."""
        return {r.seed: float(not r.ok) for r in (*self.ok, *self.failures)}

    def _reader(self, name: str) -> Callable[[Record], float | None]:
        """What finds a metric's value in a record."""
        if self.metric(name).name in self.metrics:
            return lambda record: record.metrics.get(name)
        return lambda record: record.cost(name)

    def interval(self, name: str, confidence: float = CONFIDENCE) -> Interval:
        """The interval of a metric's mean; without values its mean is nan and n is 0."""
        key = (name, confidence)
        if key not in self._intervals:
            self._intervals[key] = interval(self.values(name), self.metric(name), confidence)
        return self._intervals[key]

    def failure_interval(self, confidence: float = CONFIDENCE) -> Interval:
        """The interval of the share of repetitions that fail, interrupted ones left out.

        Raises:
            ValueError: no repetition has ended.
        """
        return proportion(len(self.failures), len(self.ok) + len(self.failures), confidence)

    def judge(self, name: str, claim: Claim) -> Judgement:
        """What the repetitions say of a claim about a metric's true mean."""
        return self._decide(claim, lambda: self._judged(self.metric(name)))

    def _judged(self, metric: Metric) -> Interval:
        """The interval by which claims about a metric, or about failures, are judged."""
        level = confidence(metric, self.error)
        if metric is FAILURES:
            return self.failure_interval(level)
        return self.interval(metric.name, level)

    def _decide(self, claim: Claim, interval: Callable[[], Interval]) -> Judgement:
        return judge(claim, interval())

    def assert_at_least(self, name: str, threshold: float) -> None:
        """Fail when the true mean is below `threshold`; shares are in 0..1.

        Raises:
            LimitError: a threshold that the metric cannot reach; so do the other assertions.
        """
        __tracebackhide__ = True
        self._assert(name, at_least(threshold))

    def assert_at_most(self, name: str, threshold: float) -> None:
        """Fail when the true mean is above `threshold`; shares are in 0..1."""
        __tracebackhide__ = True
        self._assert(name, at_most(threshold))

    def assert_between(self, name: str, low: float, high: float) -> None:
        """Fail when the true mean is outside `low`..`high`; shares are in 0..1."""
        __tracebackhide__ = True
        for value in (low, high):
            check_threshold(self.metric(name), value)
        if low > high:
            raise ValueError(f"{name} cannot lie between {low:g} and {high:g}: low is above high")
        self._assert(name, at_least(low), at_most(high))

    def assert_no_failures(self) -> None:
        """Fail when a repetition failed, or when none was recorded."""
        __tracebackhide__ = True
        self._assert_recorded()
        if self.failures:
            raise AssertionError(self._failed())

    def assert_failures_at_most(self, share: float) -> None:
        """Fail when more than `share` (0..1) of all repetitions ever made would fail."""
        __tracebackhide__ = True
        check_threshold(FAILURES, share)
        self._assert_recorded()
        found = self._decide(at_most(share), lambda: self._judged(FAILURES))
        sentence = f"{self._failed()} ({self._bounds(FAILURES, found.interval)})"
        self._tell([found], FAILURES, lambda: sentence)

    def _assert(self, name: str, *claims: Claim) -> None:
        __tracebackhide__ = True
        metric = self.metric(name)
        for claim in claims:
            check_threshold(metric, claim.value)
        self._assert_recorded()
        if not self.ok:
            raise AssertionError(f"{name} cannot be judged: {self._failed()}")
        if not self.values(name):
            raise AssertionError(
                f"{self.label}: {name} is not available in any of {len(self.ok)} repetitions"
            )
        found = [self.judge(name, claim) for claim in claims]
        self._tell(found, metric, lambda: self._measured(metric))

    def _tell(
        self, found: Sequence[Judgement], metric: Metric, measured: Callable[[], str]
    ) -> None:
        """Fail, warn or say nothing."""
        __tracebackhide__ = True
        self.judged += [(metric, judgement) for judgement in found]
        for judgement in found:
            if judgement.verdict is Verdict.REFUTED:
                wrong = "below" if judgement.claim.relation == "at least" else "above"
                limit = metric.format(judgement.claim.value)
                raise AssertionError(f"{measured()}, which is {wrong} {limit}")
        for judgement in found:
            if not judgement.verdict.decided:
                claim = f"{judgement.claim.relation} {metric.format(judgement.claim.value)}"
                text = f"{measured()}: {judgement.verdict} whether {claim}, {judgement.advice}"
                if self.strict:
                    raise AssertionError(f"{text} (--sim-strict)")
                if self.warns:
                    warnings.warn(text, InconclusiveWarning, stacklevel=4)

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

    def _measured(self, metric: Metric) -> str:
        """What was measured, with simulator, mode, profile, bounds and number of repetitions."""
        found = self._judged(metric)
        failed = f", {len(self.failures)} failed" if self.failures else ""
        return (
            f"{self.label}: {metric.name} is {metric.format(found.mean)} on average "
            f"({self._bounds(metric, found)}, {found.n} repetition{'s' if found.n > 1 else ''}"
            f"{failed})"
        )

    def _failed(self) -> str:
        """How many failed and why, the most frequent cause first, with its first message."""
        total = len(self.ok) + len(self.failures)
        text = f"{self.label}: {len(self.failures)} of {total} repetitions failed"
        reasons = [
            f"{len(records)} x {cause}{_example(records)}"
            for cause, records in self.causes().items()
        ]
        return text + (f": {'; '.join(reasons)}" if reasons else "")


def _example(records: Sequence[Record]) -> str:
    first = records[0]
    message = first.error.message if first.error else ""
    place = f"repetition {first.repetition}, seed {first.seed}"
    return f" ({place}: {message})" if message else f" ({place})"
