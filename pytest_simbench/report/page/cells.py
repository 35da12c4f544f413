"""Tables of the page: cells with a value to sort by and a verdict to colour by."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from pytest_simbench.measure.limits import CRASHED
from pytest_simbench.records.metrics import Metric
from pytest_simbench.report.model import cells
from pytest_simbench.report.model.answer import short_labels, standing
from pytest_simbench.report.model.headline import cost_of
from pytest_simbench.report.model.pooling import Sampled, Spread
from pytest_simbench.report.model.summary import Row, TaskSummary
from pytest_simbench.report.terminal.grid import Column, capital

_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?")


class Of(NamedTuple):
    """What a line of the page is of; the filters show and hide by it."""

    simulator: str
    mode: str
    profile: str


@dataclass(frozen=True)
class Cell:
    """One cell.

    Attributes:
        lines: the first stands out.
        sort: what the column is sorted by; None: by the text.
        verdict: `ahead`, `behind`, `apart`, `same`, `open` (see `answer.Standing`), or empty where
            nothing was compared.
    """

    lines: Sequence[str]
    sort: float | None = None
    verdict: str = ""


@dataclass(frozen=True)
class TableRow:
    """One row; `of` is None where filters do not concern it, `fixed` where it is never sorted."""

    cells: Sequence[Cell]
    of: Of | None = None
    fixed: bool = False


@dataclass(frozen=True)
class Heading:
    """A column's heading; `note` says how to read the column, `left` that it holds text."""

    text: str
    note: str = ""
    left: bool = False


@dataclass(frozen=True)
class Table:
    """A table with its title and how to read it; the first column names the rows."""

    title: str
    headings: Sequence[Heading]
    lines: Sequence[TableRow]
    note: str = ""


def of(row: Row) -> Of:
    """What a row of a summary is of."""
    return Of(row.simulator, row.mode, row.profile)


def study(summary: TaskSummary) -> Table:
    """The first table: the task's own metrics, then costs; coloured by who is ahead."""
    rows = summary.rows
    columns: list[tuple[Heading, list[Cell]]] = [
        (Heading("simulator", left=True), [Cell([row.simulator, row.variant]) for row in rows]),
    ]
    failed = _judged(map(_failures, rows), CRASHED.name, summary)
    columns.append((Heading("crashed", CRASHED.doc), failed))
    for metric in summary.study:
        values = (_spread(row.metrics.get(metric.name), metric) for row in rows)
        judged = _judged(values, metric.name, summary)
        columns.append((Heading(cells.heading(metric), metric.doc), judged))
    for heading, note, name in COST_COLUMNS:
        costs = [cost_of(row, name) for row in rows]
        texts = (
            [cells.sampled(row.rss_mb) for row in rows] if name == "ram" else map(cells.cost, costs)
        )
        found = [Cell(text, _mean(cost)) for text, cost in zip(texts, costs, strict=True)]
        columns.append((Heading(heading, note), _judged(found, name, summary)))
    columns += [
        (Heading("CPU %", "of one core: mean and deviation of worker and children"),
         [Cell(cells.sampled(row.cpu_percent), _mean(row.cpu_percent)) for row in rows]),
        (Heading("start s", "from launch to the start of the task"),
         [Cell(cells.cost(row.start), _mean(row.start)) for row in rows]),
        (Heading("end s", "from launch to the end of the task"),
         [Cell(cells.cost(row.end), _mean(row.end)) for row in rows]),
    ]  # fmt: skip
    lines = [
        TableRow([found[place] for _, found in columns], of(row)) for place, row in enumerate(rows)
    ]
    title = "The study's table" if summary.protocol == "paper" else "Outcomes and costs"
    return Table(title, [heading for heading, _ in columns], lines)


COST_COLUMNS = (
    ("CPU s/sim s", "CPU seconds per simulated second of stepping", "cpu_cost"),
    ("x real time", "simulated over wall seconds of stepping", "rtf"),
    ("RAM MB", "resident memory of worker and children: mean, deviation, peak", "ram"),
)
"""Costs with a doc of their own."""


def from_columns(
    title: str, columns: Sequence[Column], note: str = "", rows: Mapping[tuple[str, ...], Of] = {}
) -> Table:
    """A table of the other reports, its title with a capital; `rows` says what the lines with these
    labels are of."""
    headings = [Heading(column.heading, left=column.left) for column in columns]
    lines = []
    joined = [column.joined() if column.left else column for column in columns[1:]]
    for found in zip(*(column.cells for column in (columns[0], *joined)), strict=True):
        line = [Cell(cell, _leading(cell)) for cell in found]
        label = tuple(found[0])
        lines.append(TableRow(line, rows.get(label), label == ("reference",)))
    return Table(capital(title), headings, lines, note)


def labelled(summary: TaskSummary) -> dict[tuple[str, ...], Of]:
    """What the rows of a task's tables are of, by either label that the tables give them."""
    found = {}
    for row, name in zip(summary.rows, short_labels(summary.rows), strict=True):
        for label in ([row.simulator, row.variant], [name]):
            found[tuple(Column("", [label]).cells[0])] = of(row)
    return found


def _judged(found: Iterable[Cell], name: str, summary: TaskSummary) -> list[Cell]:
    """The cells with what their rows are."""
    who = standing(name, summary).by_place
    return [replace(cell, verdict=who.get(place, "")) for place, cell in enumerate(found)]


def _failures(row: Row) -> Cell:
    return Cell(cells.failures(row), row.failed / row.attempts if row.attempts else None)


def _spread(found: Spread | None, metric: Metric) -> Cell:
    """Mean, interval, smallest and largest; of yes-or-no how many of how many."""
    if found is None:
        return Cell([cells.MISSING])
    if metric.kind == "yes_no":
        return Cell(cells.spread(found, metric), found.mean)
    ends = " to ".join(
        dict.fromkeys(cells.metric_value(value, metric) for value in (found.min, found.max))
    )
    mean = cells.metric_value(found.mean, metric)
    lines = [mean, cells.interval(found, metric), ends if ends != mean else ""]
    return Cell([line for line in lines if line], found.mean)


def _mean(found: Spread | Sampled | None) -> float | None:
    return None if found is None else found.mean


def _leading(cell: Sequence[str]) -> float | None:
    """The number that a cell's text begins with."""
    found = _NUMBER.match(cell[0]) if cell else None
    return float(found[0]) if found else None
