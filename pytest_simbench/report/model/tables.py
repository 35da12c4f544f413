"""The tables of a task, the same in every medium."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from pytest_simbench.records.metrics import CRASHED, Metric
from pytest_simbench.report.model import cells
from pytest_simbench.report.model.answer import sentences, standing
from pytest_simbench.report.model.document import Cell, Column, Content, Section, Table
from pytest_simbench.report.model.pooling import Spread, merged_order
from pytest_simbench.report.model.summary import PHASES, SHOWN_COSTS, Row, TaskSummary

COUNTED = (
    "A crash counts with the worst value of a share or a yes-or-no metric, but by --protocol "
    "paper, and in nothing else. Lengths, times and costs have no interval for fewer than 5 "
    "values, nor where all are alike. CPU in % of one core and RAM in MB: mean +- deviation of "
    "worker and children, each repetition counting the same. x real time: simulated over wall "
    "seconds of stepping; at full speed, compare CPU s per simulated s. Start and end of the "
    "task: seconds from launch."
)
"""Of what the numbers are, in every medium."""

LEGEND = (
    f"min / mean / max over the repetitions, [95 % interval of the mean]. {COUNTED} Rows beat each "
    "other or differ where that is 95 % certain of all outcomes together, or of all costs."
)
"""How to read the tables, in one paragraph."""

CRASHES = "crashes"
"""Title of the table of failures, which the page tells in its own way."""

MATRIX = "the row beats the column at (in brackets: differs from it)"
"""Title of the matrix."""

BY_PHASE = "CPU and RAM by phase: means over all samples taken in it"
"""Title of the table that only the written report has, for its width."""

COST_HEADINGS = {
    "cpu": ("CPU %", "of one core: mean and deviation of worker and children"),
    "ram": ("RAM MB", "resident memory of worker and children: mean, deviation, peak"),
    "rtf": ("x real time", "simulated over wall seconds of stepping"),
    "cpu_cost": ("CPU s/sim s", "CPU seconds per simulated second of stepping"),
    "start": ("start s", "from launch to the start of the task"),
    "end": ("end s", "from launch to the end of the task"),
}
"""Heading and note."""

UNDESCRIBED = (
    "the run does not say what its metrics mean (an older pytest-simbench wrote it, or its tasks."
    "jsonl is lost), so they are shown as plain numbers: no unit, and neither better nor worse"
)

Shown = Callable[[Spread | None, Metric], Cell]
"""How the cell of a metric is written."""


def section(summary: TaskSummary, shown: Shown = cells.spread) -> Section:
    """All that is told of a task, but for `LEGEND`."""
    paper = summary.protocol == "paper"
    found = [
        Table("The study's table" if paper else "Outcomes and costs", study(summary, shown)),
        Table(CRASHES, failures(summary)),
        Table("why the task fell short", reasons(summary)),
        Table("further metrics: mean [95 % interval]", stricter(summary)),
        Table(MATRIX, matrix(summary)),
        Table("where the time went: mean wall seconds and share", time_spent(summary)),
        Table(BY_PHASE, by_phase(summary)),
    ]
    tables = [table for table in found if table.columns]
    return Section(title(summary), sentences(summary), tables, notes(summary), summary.task)


def compared(summary: TaskSummary) -> Section:
    """In what the rows of a task differ."""
    found = matrix(summary)
    return replace(section(summary), tables=[Table("", found, MATRIX)] if found else [])


def study(summary: TaskSummary, shown: Shown = cells.spread) -> list[Column]:
    """The first table: crashes, the task's own metrics, then costs."""
    rows = summary.rows

    def judged(name: str, found: Iterable[Cell]) -> list[Cell]:
        """The cells with what their rows are at the metric of that name."""
        who = standing(name, summary).verdicts
        return [replace(cell, verdict=who.get(place, "")) for place, cell in enumerate(found)]

    failed = judged(CRASHED.name, map(cells.failures, rows))
    columns = [labels(rows), Column("crashed", failed, "outcome", note=CRASHED.doc)]
    for metric in summary.study:
        values = judged(metric.name, (shown(row.metrics.get(metric.name), metric) for row in rows))
        columns.append(Column(cells.heading(metric), values, "outcome", note=metric.doc))
    for name in SHOWN_COSTS:
        write = cells.sampled if name in ("cpu", "ram") else cells.cost
        heading, note = COST_HEADINGS[name]
        values = judged(name, (write(row.costs.get(name)) for row in rows))
        columns.append(Column(heading, values, "cost", note=note))
    return columns


def brief(summary: TaskSummary) -> list[Column]:
    """The same in one line for each row, without bounds of costs; the least important come last."""
    _, crashed, *others = study(summary, cells.mean_interval)
    metrics, costs = others[: -len(SHOWN_COSTS)], others[-len(SHOWN_COSTS) :]
    by_name = dict(zip(SHOWN_COSTS, costs, strict=True))
    return [
        Column("simulator", summary.names, left=True, above=True),
        replace(crashed, content=[cell.lines[0] for cell in crashed.cells]),
        *(column.joined() for column in metrics),
        *(
            Column(cost.heading, [cell.lines[0].partition(" ")[0] for cell in cost.cells])
            for cost in (by_name[name] for name in ("cpu_cost", "ram", "rtf"))
        ),
    ]


def stricter(summary: TaskSummary) -> list[Column]:
    """The other metrics: mean and interval, with the reference of a perfect run as first row."""
    rows = summary.rows
    shown = [m for m in summary.stricter if any(row.metrics.get(m.name) for row in rows)]
    if not shown:
        return []
    known = any(metric.name in summary.references for metric in shown)
    columns = [labels(rows, first="reference" if known else "")]
    for metric in shown:
        values: list[Content] = []
        if known:
            right = summary.references.get(metric.name)
            values.append("" if right is None else cells.metric_value(right, metric))
        values += [cells.mean_interval(row.metrics.get(metric.name), metric) for row in rows]
        columns.append(Column(cells.heading(metric), values, "stricter"))
    return columns


def time_spent(summary: TaskSummary) -> list[Column]:
    """Where the wall time went: mean seconds and share of the total, by phase."""
    rows = [row for row in summary.rows if row.seconds.get("total")]
    if not rows:
        return []

    def spent(row: Row, phase: str) -> list[str]:
        seconds = row.seconds.get(phase)
        if seconds is None:
            return [cells.MISSING]
        return [cells.number(seconds, 2), f"({100 * seconds / row.seconds['total']:.0f} %)"]

    columns = [labels(rows)]
    for phase in PHASES:
        if phase not in ("compile", "policy") or any(row.seconds.get(phase) for row in rows):
            columns.append(Column(f"{phase} s", [spent(row, phase) for row in rows], "time"))
    totals = [cells.number(row.seconds["total"], 3) for row in rows]
    return [*columns, Column("total s", totals, "time")]


def by_phase(summary: TaskSummary) -> list[Column]:
    """CPU and RAM in each phase of the task: means over all samples taken in it."""
    rows = [row for row in summary.rows if row.by_phase]

    def used(row: Row, phase: str) -> list[str]:
        if phase not in row.by_phase:
            return [cells.MISSING]
        cpu, memory = row.by_phase[phase]
        return [f"{cpu.mean:.0f} %", f"{memory.mean:.0f} MB"]

    phases = merged_order(row.by_phase for row in rows)
    columns = [labels(rows)] if rows else []
    return columns + [Column(p, [used(row, p) for row in rows], "resources") for p in phases]


def failures(summary: TaskSummary) -> list[Column]:
    """What went wrong: count, type, phase, message, and where to read on."""
    found = [(row, cause) for row in summary.rows for cause in row.causes]
    if not found:
        return []
    causes = [cause for _, cause in found]
    shown = [
        "; ".join(
            [cause.message or cause.error.type]
            + [f"last line of its log: {line.strip()}" for line in cause.tail[-1:]]
            + ([f"log: {cause.log}"] if cause.log else [])
        )
        for cause in causes
    ]
    return [
        Column("simulator", [row.label for row, _ in found], left=True, wrap=True),
        Column("count", [str(len(cause.repetitions)) for cause in causes]),
        Column("failure", [cause.error.type for cause in causes], left=True),
        Column("phase", [cause.error.phase or cells.MISSING for cause in causes], left=True),
        Column("repetitions", [numbers(cause.repetitions) for cause in causes], left=True),
        Column("message", shown, left=True, wrap=True),
    ]


def reasons(summary: TaskSummary) -> list[Column]:
    """Why the task fell short, in its own words, and how often; numbers that vary are `#`."""
    found = [(row, text, count) for row in summary.rows for text, count in row.reasons]
    if not found:
        return []
    return [
        Column("simulator", [row.label for row, *_ in found], left=True, wrap=True),
        Column("count", [str(count) for *_, count in found]),
        Column("reason", [text for _, text, _ in found], left=True, wrap=True),
    ]


def matrix(summary: TaskSummary) -> list[Column]:
    """Which row beats which column at what; without rows that differ from none."""
    found: dict[tuple[int, int], list[str]] = {}
    for item in summary.differences:
        if item.winner is not None:
            found.setdefault((item.winner, item.loser), []).append(item.metric.name)
        elif item.verdict == "different":
            for pair in ((item.a, item.b), (item.b, item.a)):
                found.setdefault(pair, []).append(f"({item.metric.name})")
    places = sorted({place for pair in found for place in pair})
    if not places:
        return []

    def beaten(place: int, loser: int) -> list[str]:
        metrics = found.get((place, loser), [])
        if not metrics:
            return ["" if place == loser else cells.MISSING]
        return [f"{name}," for name in metrics[:-1]] + metrics[-1:]

    names, of = summary.names, [summary.rows[place].of for place in places]
    rows = [Cell([names[place]], of=who) for place, who in zip(places, of, strict=True)]
    return [
        Column("simulator", rows, left=True),
        *(
            Column(names[k], [beaten(place, k) for place in places], names[k], left=True)
            for k in places
        ),
    ]


def title(summary: TaskSummary) -> str:
    """Task, number of repetitions and protocol in one line."""
    counts = sorted({row.attempts for row in summary.rows})
    many = f"{counts[0]}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
    plural = "" if counts[-1] == 1 else "s"
    each = " each" if len(summary.rows) > 1 else ""
    return f"{summary.task}: {many} repetition{plural}{each}, protocol {summary.protocol}"


def notes(summary: TaskSummary) -> list[str]:
    """What a reader must know of the metrics, and of single rows."""
    found = [f"{summary.task}: {text}" for text in of_run(summary)]
    return found + [f"{row.label}: {text}" for row in summary.rows for text in row.notes]


def of_run(summary: TaskSummary) -> list[str]:
    """What a reader must know of the run that a task was part of."""
    again = (
        f"judged {summary.looks} times, since repetitions were added after a verdict; intervals "
        "and verdicts are those of a single look, and err more often than they say"
    )
    return [UNDESCRIBED] * (not summary.described) + [again] * (summary.looks > 1)


def deviations(summaries: Sequence[TaskSummary]) -> list[tuple[str, str]]:
    """What each simulator cannot express of the scene, as its adapter declares it."""
    rows = [row for summary in summaries for row in summary.rows]
    return sorted({(row.simulator, text) for row in rows for text in row.deviations})


def labels(rows: Sequence[Row], first: str = "") -> Column:
    """The column that names the rows."""
    cells = [Cell([row.simulator, row.variant], of=row.of) for row in rows]
    return Column("simulator", [*[Cell([first])] * bool(first), *cells], left=True)


def numbers(values: Sequence[int], most: int = 4) -> str:
    """The first few of them: `3, 7, 8, ...`."""
    shown = ", ".join(str(value) for value in values[:most])
    return f"{shown}, ..." if len(values) > most else shown
