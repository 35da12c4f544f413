"""The columns of every table, for the terminal and Markdown alike."""

from __future__ import annotations

from collections.abc import Sequence

from pytest_simbench.report.model import cells
from pytest_simbench.report.model.answer import short_labels
from pytest_simbench.report.model.pooling import merged_order
from pytest_simbench.report.model.summary import PHASES, Row, TaskSummary
from pytest_simbench.report.terminal.grid import Column

LEGEND = (
    "min / mean / max over the finished repetitions, [95 % interval of the mean]; none for fewer "
    "than 5 values and for values that are all alike. CPU in % of one core and RAM in MB: mean +- "
    "deviation of worker and children, each repetition counting the same. x real time: "
    "simulated over wall seconds of stepping; at full speed, compare CPU s per simulated s. Start "
    "and end of the task: seconds from launch. Rows beat each other or differ where that is 95 % "
    "certain of all outcomes together, or of all costs."
)
"""How to read the tables, in one paragraph."""


MATRIX = "the row beats the column at (in brackets: differs from it)"
"""Title of the matrix."""

BY_PHASE = "CPU and RAM by phase: means over all samples taken in it"
"""Title of the table that only the written report has, for its width."""


def study(summary: TaskSummary) -> list[Column]:
    """The first table: crashes, the task's own metrics, then costs."""
    rows = summary.rows
    return [
        labels(rows),
        Column("crashed", [cells.failures(row) for row in rows], "outcome"),
        *(
            Column(
                cells.heading(metric),
                [cells.spread(row.metrics.get(metric.name), metric) for row in rows],
                "outcome",
            )
            for metric in summary.study
        ),
        Column("CPU %", [cells.sampled(row.cpu_percent) for row in rows], "cost"),
        Column("RAM MB", [cells.sampled(row.rss_mb) for row in rows], "cost"),
        Column("x real time", [cells.cost(row.real_time_factor) for row in rows], "cost"),
        Column("CPU s/sim s", [cells.cost(row.cpu_cost) for row in rows], "cost"),
        Column("start s", [cells.cost(row.start) for row in rows], "cost"),
        Column("end s", [cells.cost(row.end) for row in rows], "cost"),
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
        values = [cells.mean_interval(row.metrics.get(metric.name), metric) for row in rows]
        if known:
            reference = summary.references.get(metric.name)
            text = "" if reference is None else cells.metric_value(reference, metric)
            values.insert(0, [text])
        columns.append(Column(cells.heading(metric), values, "stricter"))
    return columns


def time_spent(summary: TaskSummary) -> list[Column]:
    """Where the wall time went: mean seconds and share of the total, by phase."""
    rows = [row for row in summary.rows if row.seconds.get("total")]
    if not rows:
        return []
    columns = [labels(rows)]
    for phase in PHASES:
        if phase == "compile" and not any(row.seconds.get(phase) for row in rows):
            continue
        texts = []
        for row in rows:
            seconds = row.seconds.get(phase)
            share = 0.0 if seconds is None else 100 * seconds / row.seconds["total"]
            texts.append(
                [cells.MISSING]
                if seconds is None
                else [cells.number(seconds, 2), f"({share:.0f} %)"]
            )
        columns.append(Column(f"{phase} s", texts, "time"))
    totals = [[cells.number(row.seconds["total"], 3)] for row in rows]
    return [*columns, Column("total s", totals, "time")]


def by_phase(summary: TaskSummary) -> list[Column]:
    """CPU and RAM in each phase of the task: means over all samples taken in it."""
    rows = [row for row in summary.rows if row.by_phase]
    columns = [labels(rows)] if rows else []
    for phase in merged_order(row.by_phase for row in rows):
        texts = []
        for row in rows:
            if phase in row.by_phase:
                cpu, memory = row.by_phase[phase]
                texts.append([f"{cpu.mean:.0f} %", f"{memory.mean:.0f} MB"])
            else:
                texts.append([cells.MISSING])
        columns.append(Column(phase, texts, "resources"))
    return columns


def failures(summary: TaskSummary) -> list[Column]:
    """What went wrong: count, type, phase, message, and where to read on."""
    found = [(row, cause) for row in summary.rows for cause in row.causes]
    if not found:
        return []
    causes = [cause for _, cause in found]
    shown = [
        "; ".join(
            [cause.message or cause.type]
            + ([f"last line of its log: {cause.last_line}"] if cause.last_line else [])
            + ([f"log: {cause.log}"] if cause.log else [])
        )
        for cause in causes
    ]
    return [
        Column("simulator", [[row.label] for row, _ in found], left=True, wrap=True),
        Column("count", [[str(len(cause.repetitions))] for cause in causes]),
        Column("failure", [[cause.type] for cause in causes], left=True),
        Column("phase", [[cause.phase or cells.MISSING] for cause in causes], left=True),
        Column("repetitions", [[numbers(cause.repetitions)] for cause in causes], left=True),
        Column("message", [[text] for text in shown], left=True, wrap=True),
    ]


def reasons(summary: TaskSummary) -> list[Column]:
    """Why the task fell short, in its own words, and how often; numbers that vary are `#`."""
    found = [(row, text, count) for row in summary.rows for text, count in row.reasons]
    if not found:
        return []
    return [
        Column("simulator", [[row.label] for row, *_ in found], left=True, wrap=True),
        Column("count", [[str(count)] for *_, count in found]),
        Column("reason", [[text] for _, text, _ in found], left=True, wrap=True),
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
    names = short_labels(summary.rows)
    columns = [Column("simulator", [[names[place]] for place in places], left=True)]
    for loser in places:
        cells_ = [_beaten(found.get((place, loser), []), place == loser) for place in places]
        columns.append(Column(names[loser], cells_, names[loser], left=True))
    return columns


def _beaten(metrics: list[str], same: bool) -> list[str]:
    if not metrics:
        return ["" if same else cells.MISSING]
    return [f"{name}," for name in metrics[:-1]] + metrics[-1:]


def details(summary: TaskSummary) -> list[tuple[str, list[Column]]]:
    """The tables below the first, each with its title; a table without columns is left out."""
    found = [
        ("crashes", failures(summary)),
        ("why the task fell short", reasons(summary)),
        ("further metrics: mean [95 % interval]", stricter(summary)),
        (MATRIX, matrix(summary)),
        ("where the time went: mean wall seconds and share", time_spent(summary)),
    ]
    return [(name, columns) for name, columns in found if columns]


def title(summary: TaskSummary) -> str:
    """Task, number of repetitions and protocol in one line."""
    counts = sorted({row.attempts for row in summary.rows})
    many = f"{counts[0]}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
    plural = "" if counts[-1] == 1 else "s"
    each = " each" if len(summary.rows) > 1 else ""
    return f"{summary.task}: {many} repetition{plural}{each}, protocol {summary.protocol}"


UNDESCRIBED = (
    "the run does not say what its metrics mean (an older pytest-simbench wrote it, or its tasks."
    "jsonl is lost), so they are shown as plain numbers: no unit, and neither better nor worse"
)


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
    found = {
        (row.simulator, text)
        for summary in summaries
        for row in summary.rows
        for text in row.deviations
    }
    return sorted(found)


def labels(rows: Sequence[Row], first: str = "") -> Column:
    """The column that names the rows."""
    texts = [[row.simulator, row.variant] for row in rows]
    if first:
        texts.insert(0, [first])
    return Column("simulator", texts, left=True)


def numbers(values: Sequence[int], most: int = 4) -> str:
    """The first few of them: `3, 7, 8, ...`."""
    shown = ", ".join(str(value) for value in values[:most])
    return f"{shown}, ..." if len(values) > most else shown
