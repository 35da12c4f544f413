"""From records to the rows of a table: one row per test and configuration of a task.

Every renderer (terminal, Markdown, pictures) reads these rows, so that all of them tell the same
numbers. A crashed repetition counts with the worst value where a metric has one (`Record.value`);
of everything else crashed and interrupted ones are left out.
"""

from __future__ import annotations

import re
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from pytest_simbench.measure.differences import Difference
from pytest_simbench.records.choices import published_again
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.phenomena import PHENOMENON
from pytest_simbench.records.record import Record
from pytest_simbench.records.series import grouped, series
from pytest_simbench.report.model.pooling import (
    AMOUNT,
    Ends,
    Sampled,
    Spread,
    interval_ends,
    pooled,
    pooled_by_phase,
    spread,
)

PHASES = ("launch", "compile", "load", "plan", "step", "other")
"""Where the wall time of a repetition goes, in order."""


@dataclass(frozen=True)
class Cause:
    """Failures that share type and phase.

    Attributes:
        message: that of the first of them, in one line.
        last_line: the last line of that one's log.
        repetitions: their numbers, with `seeds` in the same order.
    """

    type: str
    phase: str
    message: str
    last_line: str
    repetitions: tuple[int, ...]
    seeds: tuple[int, ...]
    log: str = ""


@dataclass(frozen=True)
class Row:
    """One configuration of one simulator at one task.

    Attributes:
        test: what tells it from other rows of its simulator, mode and profile, for instance
            `timestep=0.004` or the test's function name; else empty.
        finished, failed, interrupted: counts of repetitions.
        metrics: by metric name; None where no repetition has the value.
        start, end: seconds from launch to the start and the end of the task.
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
    cpu_percent: Sampled | None = None
    rss_mb: Sampled | None = None
    by_phase: Mapping[str, tuple[Sampled, Sampled]] = field(default_factory=dict)
    real_time_factor: Spread | None = None
    cpu_cost: Spread | None = None
    start: Spread | None = None
    end: Spread | None = None
    seconds: Mapping[str, float] = field(default_factory=dict)
    causes: tuple[Cause, ...] = ()
    deviations: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    reasons: tuple[tuple[str, int], ...] = ()

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
        differences: between rows, by their places; from `matrix.with_differences`.
        modes: whether headless and GUI agree, in sentences; from there too.
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


def at_own_steps(records: Iterable[Record]) -> list[Record]:
    """The records without those of laws at other time steps than their profile's own, which have
    tables of their own (`report.sweep`)."""
    return [r for r in records if not (r.swept and PHENOMENON in r.settings)]


def summarise(
    records: Iterable[Record],
    metrics: Mapping[str, Sequence[Metric]],
    references: Mapping[str, Mapping[str, float]] | None = None,
    ends: Ends = interval_ends,
) -> list[TaskSummary]:
    """The records as one summary per task, tasks in order of appearance.

    Args:
        records: of one run, in any order.
        metrics: what each task declares, by its name; of a task that is missing here, the record's
            metrics are shown as plain values.
        references: by task, then by metric.
        ends: the intervals to show.
    """
    summaries = []
    for task, found in grouped(records, lambda r: r.task).items():
        declared = tuple(metrics[task] if task in metrics else _undeclared(found))
        rows = tuple(_row(r.records, declared, r.label, ends) for r in series(found))
        protocols = ", ".join(sorted({record.protocol for record in found}))
        known = dict((references or {}).get(task, {}))
        summaries.append(
            TaskSummary(
                task,
                declared,
                rows,
                known,
                protocols,
                described=task in metrics,
                phenomenon=str(found[0].settings.get(PHENOMENON) or ""),
            )
        )
    return summaries


def _undeclared(records: Sequence[Record]) -> list[Metric]:
    names = dict.fromkeys(name for record in records for name in record.metrics)
    return [Metric(name, name, better=None, study=True) for name in names]


def _row(records: Sequence[Record], metrics: Sequence[Metric], test: str, ends: Ends) -> Row:
    first = records[0]
    done = [record for record in records if record.status == "ok"]
    notes = list(dict.fromkeys(r.notes.untested for r in records if r.notes.untested))
    again = published_again((r.task, r.seed, r.notes.sample, r.notes.chosen_on) for r in done)
    notes += [again] * bool(again)
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
        failed=sum(record.status == "failed" for record in records),
        interrupted=sum(record.status == "interrupted" for record in records),
        metrics={
            metric.name: spread([r.value(metric) for r in records], metric, ends)
            for metric in metrics
        },
        cpu_percent=pooled([r.resources for r in done], "cpu_percent", ends),
        rss_mb=pooled([r.resources for r in done], "rss_mb", ends),
        by_phase=pooled_by_phase([r.resources for r in done]),
        real_time_factor=spread([r.cost("rtf") for r in done], AMOUNT, ends),
        cpu_cost=spread([r.cost("cpu_cost") for r in done], AMOUNT, ends),
        start=spread([r.cost("start") for r in done], AMOUNT, ends),
        end=spread([r.cost("end") for r in done], AMOUNT, ends),
        seconds=_seconds(done),
        causes=_causes(records),
        deviations=tuple(dict.fromkeys(text for r in records for text in r.deviations)),
        notes=tuple(notes),
        reasons=_reasons(done),
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


def _causes(records: Sequence[Record]) -> tuple[Cause, ...]:
    failed = (record for record in records if record.status == "failed")
    groups = grouped(
        failed, lambda r: (r.error.type, r.error.phase) if r.error else ("unknown", "")
    )
    causes = []
    for (kind, phase), group in sorted(groups.items(), key=lambda item: -len(item[1])):
        error = group[0].error
        tail = error.log_tail.strip().splitlines() if error else []
        causes.append(
            Cause(
                kind,
                phase,
                " ".join(error.message.split()) if error else "the record names no cause",
                tail[-1].strip() if tail else "",
                tuple(record.repetition for record in group),
                tuple(record.seed for record in group),
                group[0].notes.log,
            )
        )
    return tuple(causes)
