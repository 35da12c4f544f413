"""What changed since a baseline: for the terminal, and as Markdown for the page of a CI job."""

from __future__ import annotations

from collections.abc import Iterable

from pytest_simbench.ground.text import for_markdown, for_terminal
from pytest_simbench.measure.gate import Change, GateReport
from pytest_simbench.measure.limits import CRASHED
from pytest_simbench.records.series import short
from pytest_simbench.report.markdown import run as markdown
from pytest_simbench.report.terminal.grid import Column, fill, render

ALWAYS = ("rtf", "cpu_cost", "ram")
"""Costs that are shown although they may not have changed, as the study's metrics are."""

PASSED = "no metric got worse beyond its limit"
NO_LIMIT = "not significantly more repetitions crashed; no other limit was tested"


def columns(report: GateReport) -> list[Column]:
    """One line for each metric with a limit, each of the study's, and each that clearly changed."""
    rows = _rows(report)
    if not rows:
        return []
    return [
        Column("test", [[short(change.test)] for change, _ in rows], left=True),
        Column("metric", [[_name(change)] for change, _ in rows], left=True),
        Column("baseline", [[change.metric.format(change.comparison.first)] for change, _ in rows]),
        Column("now", [[change.metric.format(change.comparison.second)] for change, _ in rows]),
        Column("change", [[_amount(change)] for change, _ in rows]),
        Column("p", [[f"{change.p_value:.2g}"] for change, _ in rows]),
        Column("verdict", [[verdict] for _, verdict in rows], left=True),
    ]


def _rows(report: GateReport) -> list[tuple[Change, str]]:
    """Changes with their verdicts: by test, those with a limit first."""
    found = [
        (change, _limited(change))
        for change in report.changes
        if change.metric != CRASHED or change.comparison.first or change.comparison.second
    ]
    found += [
        (change, _free(change))
        for change in report.others
        if change.significant or change.metric.study or change.metric.name in ALWAYS
    ]
    tests = list(dict.fromkeys(change.test for change, _ in found))
    return sorted(found, key=lambda row: tests.index(row[0].test))


def _limited(change: Change) -> str:
    limit = change.limit.describe(change.metric, change.limit.amount)
    if change.exceeded:
        return f"FAILED, limit {limit}"
    if change.loss > change.limit.amount:
        return f"may be chance, limit {limit}"
    return f"passed, limit {limit}"


def _free(change: Change) -> str:
    if not change.significant:
        return "no clear change"
    return "worse" if change.loss > 0 else "better"


def _name(change: Change) -> str:
    return f"{change.metric.name} (speed out)" if change.normalised else change.metric.name


def _amount(change: Change) -> str:
    """The change of the number itself, with its sign: `-20 points`, `+3.2 %`."""
    rising = change.comparison.second > change.comparison.first
    text = change.limit.describe(change.metric, abs(change.loss))
    return f"{'+' if rising else '-'}{text}" if change.loss else "0"


DIFFERENT = "different in the baseline (a change may come from this)"


def render_terminal(report: GateReport, width: int, limited: bool) -> str:
    """The comparison as plain lines: differences first, then the table, then the verdicts.

    Args:
        report: from `run_gate`.
        width: of the terminal.
        limited: whether limits were given, so that passing is worth a sentence.
    """
    table = columns(report)
    parts = [
        _listed(DIFFERENT, report.differences, width),
        render(table, width) if table else "",
        _listed("not compared", report.notes, width),
        "\n".join(fill(f"FAILED {sentence}", width, "  ") for sentence in report.failures),
        _passed(report) if limited else "",
    ]
    return for_terminal("\n\n".join(part for part in parts if part))


def _passed(report: GateReport) -> str:
    """What is said when nothing fails."""
    if report.failures:
        return ""
    return PASSED if report.compared else NO_LIMIT


def _listed(title: str, items: Iterable[str], width: int) -> str:
    lines = [f"  {fill(item, width, '    ')}" for item in items]
    return "\n".join([f"{title}:", *lines]) if lines else ""


def render_markdown(report: GateReport, baseline: str, limited: bool) -> str:
    """The same for the page of a CI job; ends with a newline."""
    table = columns(report)
    parts = [
        f"## {for_markdown(f'Compared with {baseline}')}",
        _bullets(f"{DIFFERENT}: {sentence}" for sentence in report.differences),
        _bullets(f"FAILED {sentence}" for sentence in report.failures),
        f"Passed: {passed}." if limited and (passed := _passed(report)) else "",
        markdown.table(table) if table else "",
        _bullets(f"not compared: {sentence}" for sentence in report.notes),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _bullets(items: Iterable[str]) -> str:
    return "\n".join(f"- {for_markdown(item)}" for item in items)
