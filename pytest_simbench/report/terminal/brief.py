"""The result in the terminal when nobody asks for more: the answer, a line for each row, warnings.

Everything else is in the report, and in the terminal with `-v` (`tables`).
"""

from __future__ import annotations

from collections.abc import Sequence

from pytest_simbench.ground.text import for_terminal, in_one_line
from pytest_simbench.report.model import cells, truth
from pytest_simbench.report.model import tables as columns
from pytest_simbench.report.model.answer import short_labels
from pytest_simbench.report.model.headline import cost_of, headline
from pytest_simbench.report.model.summary import TaskSummary
from pytest_simbench.report.terminal.grid import GAP, Column, fill, render
from pytest_simbench.report.terminal.run import NARROWEST

MOST_LINES = 38
"""For the whole result; two further ones tell its title and where the report is. Rows are never
left out, only warnings."""

LEAST_ROOM = 3
"""Lines for warnings, however many rows there are."""

LONGEST_WARNING = 2
"""Lines of one warning; the rest of it is in the report."""

MORE = "with -v and in the report"


def render_brief(summaries: Sequence[TaskSummary], width: int = 80) -> str:
    """The result as plain lines of at most `width` columns; empty without a task."""
    if not summaries:
        return ""
    width = max(width, NARROWEST)
    tasks = truth.others(summaries)
    parts = [truth.brief(summaries, width)]
    parts.append("\n".join(fill(sentence, width, "  ") for sentence in headline(tasks)))
    for summary in tasks:
        title = fill(in_one_line(columns.title(summary)), width)
        parts.append(f"{title}\n{render(table(summary, width), width)}")
    text = "\n\n".join(filter(None, parts))
    room = max(LEAST_ROOM, MOST_LINES - len(text.splitlines()) - 1)
    return for_terminal("\n\n".join(filter(None, [text, _warned(summaries, width, room)])))


def _warned(summaries: Sequence[TaskSummary], width: int, room: int) -> str:
    """As many warnings as there is room for [lines], and how many more there are."""
    found = [_short(item, width) for item in warnings(summaries)]
    if sum(map(len, found)) <= room:
        return "\n".join("\n".join(item) for item in found)
    shown = []
    for item in found:
        room -= len(item)
        if room < 1:  # the last line tells how many are left out
            break
        shown.append("\n".join(item))
    return "\n".join([*shown, f"{len(found) - len(shown)} more warnings {MORE}"])


def _short(text: str, width: int) -> list[str]:
    lines = fill(in_one_line(text), width, "  ").split("\n")
    if len(lines) > LONGEST_WARNING:
        lines[LONGEST_WARNING - 1] = f"{lines[LONGEST_WARNING - 1][: width - 4]} ..."
    return lines[:LONGEST_WARNING]


def table(summary: TaskSummary, width: int) -> list[Column]:
    """One line for each row; the last columns are left out where they do not fit."""
    rows = summary.rows
    metrics = summary.study
    found = [
        Column("simulator", [[name] for name in short_labels(rows)], left=True),
        Column("crashed", [[f"{row.failed} of {row.attempts}"] for row in rows]),
    ]
    for metric in metrics:
        values = [cells.mean_interval(row.metrics.get(metric.name), metric) for row in rows]
        found.append(Column(cells.heading(metric), values).joined())
    for heading, name, shown in (
        ("CPU s/sim s", "cpu_cost", lambda value: cells.number(value, 2)),
        ("RAM MB", "ram", "{:.0f}".format),
        ("x real time", "rtf", lambda value: cells.number(value, 2)),
    ):
        costs = [cost_of(row, name) for row in rows]
        texts = [[shown(c.mean) if c else cells.MISSING] for c in costs]
        found.append(Column(heading, texts))
    while len(found) > 2 and sum(column.width + GAP for column in found) - GAP > width:
        found.pop()
    return found


def warnings(summaries: Sequence[TaskSummary]) -> list[str]:
    """Crashes by cause, then what a reader must know of the rows, those of one text together."""
    failed = [
        f"CRASHED {summary.task}, {row.label}: {len(cause.repetitions)} x {cause.type}"
        + (f" in {cause.phase}" if cause.phase else "")
        + f": {cause.message}"
        for summary in summaries
        for row in summary.rows
        for cause in row.causes
    ]
    notes: dict[str, list[str]] = {}
    for summary in summaries:
        for name, row in zip(short_labels(summary.rows), summary.rows, strict=True):
            for text in row.notes:
                notes.setdefault(text, []).append(name)
    every = {name for summary in summaries for name in short_labels(summary.rows)}
    told = [
        f"note: {summary.task}: {text}" for summary in summaries for text in columns.of_run(summary)
    ]
    for text, names in notes.items():
        of = dict.fromkeys(names)
        told.append(f"note: {'all' if every <= of.keys() else ', '.join(of)}: {text}")
    return failed + told
