"""From records to the rows of a table, and what differs between them, computed once for all media.

A row is one test and configuration of a task. A crashed repetition counts with the worst value
where a metric has one (`Record.value`); of everything else crashed and interrupted ones are left
out.
"""

from __future__ import annotations

import re
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from pytest_simbench.measure.differences import Difference, differences
from pytest_simbench.measure.modes import compare_modes
from pytest_simbench.measure.results import ResultSet
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.phenomena import PHENOMENON
from pytest_simbench.records.record import Failure, Record, Who
from pytest_simbench.records.series import comparable, grouped, series
from pytest_simbench.records.tuned_on import published_again
from pytest_simbench.report.model.document import names
from pytest_simbench.report.model.pooling import (
    COST,
    SAMPLED,
    Spread,
    pooled,
    pooled_by_phase,
    spread,
)
from pytest_simbench.scene.pair_friction import OF_PAIRS

PHASES = ("launch", "compile", "load", "plan", "policy", "step", "other")
"""Where the wall time of a repetition goes, in order."""

SHOWN_COSTS = ("cpu", "ram", "rtf", "cpu_cost", "start", "end")
"""Costs that tables have, in their order."""


@dataclass(frozen=True)
class Cause:
    """Failures of one row that share type and phase; message and log are those of the first."""

    records: Sequence[Record]

    @property
    def error(self) -> Failure:
        return self.records[0].error or Failure("unknown", "the record names no cause")

    @property
    def repetitions(self) -> list[int]:
        """Their numbers."""
        return [record.repetition for record in self.records]

    @property
    def message(self) -> str:
        """In one line."""
        return " ".join(self.error.message.split())

    @property
    def tail(self) -> list[str]:
        """The last lines of the log, which is at `log`."""
        return self.error.log_tail.strip().splitlines()

    @property
    def log(self) -> str:
        return self.records[0].notes.log

    @property
    def told(self) -> str:
        """How many there are of what: `2 x WorkerHung in settle`."""
        return f"{len(self.records)} x {self.error.cause}"


@dataclass(frozen=True)
class Row:
    """One configuration of one simulator at one task.

    Attributes:
        test: what tells it from other rows of its simulator, mode and profile, for instance
            `timestep=0.004` or the test's function name; else empty.
        finished, failed, interrupted: counts of repetitions.
        metrics: by metric name; None where no repetition has the value.
        costs: by the names of `metrics.COSTS`: those of `SHOWN_COSTS`.
        by_phase: CPU in % of a core and RAM in MB by the task's phase, in order.
        seconds: mean wall seconds by phase (`PHASES`, `total`).
        notes: what a reader must know of these numbers (parallel repetitions, reused worker).
        reasons: why scores are no better, in the task's words, and how often; the most frequent
            first. Those that differ in numbers alone are counted together.
    """

    task: str
    simulator: str
    mode: str
    profile: str
    test: str = ""
    finished: int = 0
    failed: int = 0
    interrupted: int = 0
    metrics: Mapping[str, Spread | None] = field(default_factory=dict)
    costs: Mapping[str, Spread | None] = field(default_factory=dict)
    by_phase: Mapping[str, tuple[Spread, Spread]] = field(default_factory=dict)
    seconds: Mapping[str, float] = field(default_factory=dict)
    causes: tuple[Cause, ...] = ()
    deviations: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    reasons: tuple[tuple[str, int], ...] = ()
    records: Sequence[Record] = ()

    @property
    def of(self) -> Who:
        return Who(self.simulator, self.mode, self.profile)

    @property
    def attempts(self) -> int:
        """Repetitions that count: interrupted ones say nothing about the simulator."""
        return self.finished + self.failed

    @property
    def variant(self) -> str:
        """Mode and profile, and the test where it is needed, for instance `headless tuned`."""
        return " ".join(part for part in (self.mode, self.profile, self.test) if part)

    @property
    def label(self) -> str:
        return f"{self.simulator} {self.variant}"


@dataclass(frozen=True)
class TaskSummary:
    """All rows of one task.

    Attributes:
        metrics: what the task declares; those with `study` make its first table, else all.
        references: the value a perfect run would give, by metric name.
        protocol: the protocol of its records; several are joined by commas.
        differences: between rows of one mode and profile, by their places. Of laws there are none:
            they are no sample of anything, see `measure.phenomena`.
        modes: whether headless and GUI agree, in sentences.
        described: whether the run says what the metrics mean; else they are plain numbers.
        phenomenon: that the task is a law of; empty of one that is none.
        looks: how often the run was judged, see `outcome.Outcome`.
    """

    task: str
    metrics: tuple[Metric, ...]
    rows: tuple[Row, ...]
    references: Mapping[str, float] = field(default_factory=dict)
    protocol: str = ""
    differences: tuple[Difference, ...] = ()
    modes: tuple[str, ...] = ()
    described: bool = True
    phenomenon: str = ""
    looks: int = 1

    @property
    def study(self) -> tuple[Metric, ...]:
        """Those of the first table: what the reference study reports too, else all."""
        return tuple(metric for metric in self.metrics if metric.study) or self.metrics

    @property
    def stricter(self) -> tuple[Metric, ...]:
        """The others."""
        return tuple(metric for metric in self.metrics if metric not in self.study)

    @property
    def names(self) -> list[str]:
        """What tells the rows apart: mode, profile and test only where they differ."""
        return short_labels(self.rows)


def short_labels(rows: Sequence[Row]) -> list[str]:
    """Names that tell the rows apart."""
    return names([(*row.of, row.test) for row in rows])


def at_own_steps(records: Iterable[Record]) -> list[Record]:
    """The records without those of laws at other time steps than their profile's own, which have
    tables of their own (`report.sweep`)."""
    return [r for r in records if not (r.swept and PHENOMENON in r.settings)]


def summarise(
    records: Iterable[Record],
    metrics: Mapping[str, Sequence[Metric]],
    references: Mapping[str, Mapping[str, float]] | None = None,
) -> list[TaskSummary]:
    """The records of one run as one summary per task, tasks in order of appearance.

    Metrics and references are what each task declares. Of a task that is missing there, the
    record's metrics are shown as plain values.
    """
    return [
        _summary(task, found, metrics.get(task), dict((references or {}).get(task, {})))
        for task, found in grouped(records, lambda r: r.task).items()
    ]


def _summary(
    task: str,
    records: Sequence[Record],
    declared: Sequence[Metric] | None,
    references: Mapping[str, float],
) -> TaskSummary:
    metrics = tuple(_undeclared(records) if declared is None else declared)
    found = series(records)
    phenomenon = str(records[0].settings.get(PHENOMENON) or "")
    apart: list[Difference] = []
    modes: list[str] = []
    if not phenomenon:
        sides = {place: row.records for place, row in enumerate(found)}
        alone = len({row.records[0].simulator for row in found}) == 1
        apart = differences(
            sides, metrics, lambda a, b: comparable(found[a], found[b], profiles=alone), references
        )
        ordered = [record for row in found for record in row.records]
        modes = compare_modes(ordered, metrics)
    return TaskSummary(
        task,
        metrics,
        tuple(_row(row.records, metrics, row.label) for row in found),
        references,
        ", ".join(sorted({record.protocol for record in records})),
        tuple(apart),
        tuple(modes),
        described=declared is not None,
        phenomenon=phenomenon,
    )


def _undeclared(records: Sequence[Record]) -> list[Metric]:
    names = dict.fromkeys(name for record in records for name in record.metrics)
    return [Metric(name, name, better=None, study=True) for name in names]


def _row(records: Sequence[Record], metrics: Sequence[Metric], test: str) -> Row:
    first, results = records[0], ResultSet(records, metrics)
    done = results.ok
    notes = list(dict.fromkeys(r.notes.untested for r in records if r.notes.untested))
    told = dict.fromkeys(text for r in records for text in r.deviations)
    notes += [text for text in told if text.startswith(OF_PAIRS)]
    again = published_again((r.task, r.seed, r.notes.sample, r.notes.chosen_on) for r in done)
    notes += [again] * bool(again)
    without = {m.name: results.without(m) for m in metrics}
    if lacking := [f"{k} {n} of {len(done)}" for k, n in without.items() if 0 < n < len(done)]:
        notes.append(f"finished repetitions without a value: {', '.join(lacking)}")
    if (opened := max((r.notes.opened for r in done), default=0.0)) > 0:
        notes.append(f"loops of links stood open at the end, by up to {1000 * opened:.2g} mm")
    if any(record.contended for record in done):
        notes.append("repetitions ran in parallel: its times and CPU are contended")
    if any(record.notes.filmed for record in done):
        notes.append("repetitions were filmed: CPU and RAM are those of simulator and renderer")
    if any(record.reused_worker for record in done):
        notes.append("one worker served several repetitions: launch and memory are not fresh")
    return Row(
        first.task,
        first.simulator,
        first.mode,
        first.profile,
        test,
        finished=len(done),
        failed=len(results.crashed),
        interrupted=len(results.interrupted),
        metrics={
            m.name: spread(results.values(m.name), None if results.sole(m.name) else m)
            for m in metrics
        },
        costs={
            name: pooled([r.resources for r in done], name)
            if name in SAMPLED
            else spread([r.cost(name) for r in done], COST[name])
            for name in SHOWN_COSTS
        },
        by_phase=pooled_by_phase([r.resources for r in done]),
        seconds=_seconds(done),
        causes=tuple(map(Cause, results.causes().values())),
        deviations=tuple(told),
        notes=tuple(notes),
        reasons=_reasons(done),
        records=records,
    )


def _reasons(records: Sequence[Record]) -> tuple[tuple[str, int], ...]:
    told = [text for record in records for text in record.reasons]
    same = grouped(told, lambda text: _NUMBERS.sub("#", text))
    counted = [
        (texts[0] if len(set(texts)) == 1 else form, len(texts)) for form, texts in same.items()
    ]
    return tuple(sorted(counted, key=lambda item: -item[1]))


_NUMBERS = re.compile(r"-?\d+(?:\.\d+)?")


def _seconds(records: Sequence[Record]) -> dict[str, float]:
    means = {}
    for name in (*PHASES, "total"):
        found = [r.seconds[name] for r in records if r.seconds.get(name) is not None]
        if found:
            means[name] = statistics.fmean(found)
    return means
