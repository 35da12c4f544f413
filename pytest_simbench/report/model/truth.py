"""What simulators make of laws: the table of phenomena, a sentence for each, and every law's
error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import fmean

from pytest_simbench.measure.phenomena import KEPT, Ratios, Verdict, verdict, worst
from pytest_simbench.records.metrics import significant
from pytest_simbench.records.phenomena import ordered
from pytest_simbench.report.model import cells
from pytest_simbench.report.model.answer import NAMED
from pytest_simbench.report.model.document import Column, Section, Table, capital, listed
from pytest_simbench.report.model.summary import Row, TaskSummary, short_labels

TITLE = "which simulator is right about what"

CHEAPER = 0.5
"""Who costs at most so much of the next one is called the cheapest: times are of one run on a
machine that may be busy."""

LEAST_SHOWN = 0.001
"""A smaller share of a tolerance is not told in digits."""

LEGEND = (
    "7/8 12x: 7 of 8 laws are kept, and the worst is missed by 12 times its tolerance, which is "
    "what a time step may cost an integrator of the first order; fails: a repetition failed or its "
    "world diverged"
)


def laws(summaries: Sequence[TaskSummary]) -> list[TaskSummary]:
    """Those of laws."""
    return [summary for summary in summaries if summary.phenomenon]


def others(summaries: Sequence[TaskSummary]) -> list[TaskSummary]:
    """Those of everything else."""
    return [summary for summary in summaries if not summary.phenomenon]


def section(summaries: Sequence[TaskSummary]) -> Section | None:
    """All that is told of laws; None without any."""
    if not laws(summaries):
        return None
    first = Table(TITLE, table(summaries), LEGEND)
    return Section(capital(TITLE), sentences(summaries), [first, *details(summaries)])


def sentences(summaries: Sequence[TaskSummary]) -> list[str]:
    """A verdict on each phenomenon and settings profile, in words; none of a single simulator."""
    profiles = list(dict.fromkeys(row.profile for row in _rows(summaries).values()))
    found = []
    for phenomenon in _phenomena(summaries):
        for profile in profiles:
            rows = _rows(summaries, profile)
            ratios = {name: _ratios(summaries, phenomenon, row) for name, row in rows.items()}
            ratios = {name: known for name, known in ratios.items() if known}
            if len(ratios) > 1:
                costs = {name: _cost(summaries, rows[name], phenomenon) for name in ratios}
                where = f" ({profile})" if len(profiles) > 1 else ""
                found.append(f"for {phenomenon}{where}: {_told(verdict(ratios), costs)}")
    return found


def table(summaries: Sequence[TaskSummary]) -> list[Column]:
    """Simulators by phenomena, and what a simulated second costs."""
    rows = _rows(summaries)
    columns = [Column("simulator", rows, left=True)]
    for phenomenon in _phenomena(summaries):
        found = [_ratios(summaries, phenomenon, row) for row in rows.values()]
        columns.append(Column(phenomenon, map(_cell, found)))
    costs = [_cost(summaries, row) for row in rows.values()]
    shown = [cells.MISSING if cost is None else cells.number(cost, 2) for cost in costs]
    return [*columns, Column("CPU s/sim s", shown)]


def details(summaries: Sequence[TaskSummary]) -> list[Table]:
    """For each phenomenon its laws by simulators: the error in the law's unit, with its ratio to
    the tolerance where the law is not kept."""
    rows = _rows(summaries)
    found = []
    for phenomenon in _phenomena(summaries):
        asked = [summary for summary in laws(summaries) if summary.phenomenon == phenomenon]
        columns = [
            Column("law", [summary.task for summary in asked], left=True),
            Column("error in", map(_unit, asked), left=True),
        ]
        for name, of in rows.items():
            columns.append(Column(name, [_error(summary, of) for summary in asked]))
        found.append(Table(f"laws of {phenomenon}", columns))
    return found


def _rows(summaries: Sequence[TaskSummary], profile: str | None = None) -> dict[str, Row]:
    """One row of each contender, of one settings profile or of all, by its short name."""
    found: dict[str, Row] = {}
    for summary in laws(summaries):
        for row in summary.rows:
            if profile in (None, row.profile):
                found.setdefault(row.label, row)
    rows = sorted(found.values(), key=lambda row: row.profile)
    return dict(zip(short_labels(rows), rows, strict=True))


def _row(summary: TaskSummary, like: Row) -> Row | None:
    return next((row for row in summary.rows if row.label == like.label), None)


def _phenomena(summaries: Sequence[TaskSummary]) -> list[str]:
    return ordered(summary.phenomenon for summary in laws(summaries))


def _ratio(row: Row) -> float | None:
    if row.failed:
        return math.inf
    found = row.metrics.get("ratio")
    return None if found is None else found.max


def _ratios(summaries: Sequence[TaskSummary], phenomenon: str, like: Row) -> Ratios:
    found = {}
    for summary in laws(summaries):
        row = _row(summary, like)
        ratio = _ratio(row) if row else None
        if summary.phenomenon == phenomenon and ratio is not None:
            found[summary.task] = ratio
    return found


def _cost(
    summaries: Sequence[TaskSummary], like: Row, phenomenon: str | None = None
) -> float | None:
    """CPU seconds for a simulated second, the mean of the laws."""
    found = [
        cost.mean
        for summary in laws(summaries)
        if phenomenon in (None, summary.phenomenon)
        and (row := _row(summary, like)) is not None
        and (cost := row.costs.get("cpu_cost")) is not None
    ]
    return fmean(found) if found else None


def _cell(ratios: Ratios) -> str:
    if not ratios:
        return cells.MISSING
    kept = sum(ratio <= KEPT for ratio in ratios.values())
    return f"{kept}/{len(ratios)} {_times(worst(ratios))}"


def _times(ratio: float) -> str:
    if 0 < ratio < LEAST_SHOWN:
        return f"<{LEAST_SHOWN:g}x"
    return "fails" if math.isinf(ratio) else f"{significant(ratio, 2)}x"


def _error(summary: TaskSummary, like: Row) -> str:
    row = _row(summary, like)
    if row is None or (ratio := _ratio(row)) is None:
        return cells.MISSING
    error = row.metrics.get("error")
    if math.isinf(ratio) or error is None:
        return "fails"
    return f"{error.max:.2g}" + (f" ({_times(ratio)})" if ratio > KEPT else "")


def _unit(summary: TaskSummary) -> str:
    return next((metric.unit for metric in summary.metrics if metric.name == "error"), "")


def _told(found: Verdict, costs: dict[str, float | None]) -> str:
    if found.best is not None:
        text = f"{found.best}, which keeps {found.kept[found.best]} of {found.laws} laws"
    else:
        some = [f"{who} {found.kept[who]}" for who in found.unbeaten[:NAMED]]
        more = len(found.unbeaten) - len(some)
        some += [f"{more} more"] * (more > 0)
        text = f"no clear best; laws kept of {found.laws} by those that nobody beats: "
        text += listed(some) or "nobody"
        text += _cheapest({who: costs[who] for who in found.unbeaten})
    left = f"; not compared: {listed(found.incomplete)}" if found.incomplete else ""
    return f"{text}{left}."


def _cheapest(costs: dict[str, float | None]) -> str:
    known = sorted((cost, who) for who, cost in costs.items() if cost is not None)
    if len(known) < 2 or known[0][0] > CHEAPER * known[1][0]:
        return ""
    return f"; the cheapest of them: {known[0][1]}"
