"""What else the terminal shows: claims, time steps, releases, a baseline, repeatability."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from pytest_simbench.ground.text import for_terminal, in_one_line
from pytest_simbench.measure.gate import GateReport
from pytest_simbench.measure.history import History
from pytest_simbench.measure.sweep import Swept
from pytest_simbench.report.model import changes, sweep
from pytest_simbench.report.model.claims import Claims
from pytest_simbench.report.model.document import Table
from pytest_simbench.report.terminal.grid import fill, render

SHOWN = 3
"""Failures at time steps that the terminal tells without `-v`."""


def claim_lines(found: Claims, width: int) -> str:
    """The claims, as lines of at most `width` columns, but for commands."""
    columns = found.table.columns
    parts = [fill(found.sentence, width), render(columns, width) if columns else ""]
    parts.append(fill(found.table.note, width))
    for trouble in found.troubles:
        told = [fill(trouble.what, width, "  ")]
        told += [fill(f"  worst: {trouble.worst}", width, "  ")] if trouble.worst else []
        told += [f"  again: {trouble.again}"] if trouble.again else []
        parts.append("\n".join(told))
    if found.more:
        parts.append(f"{found.more} more of them in the report")
    return "\n\n".join(filter(None, parts))


def sweep_lines(found: Sequence[Swept], width: int, whole: bool) -> list[str]:
    """Laws over time steps: the table and the first failures; `whole`: every law as well."""
    told = sweep.section(found)
    if told is None:
        return []
    first, *details = told.tables
    lines = [*render(first.columns, width).splitlines(), "", *fill(first.note, width).splitlines()]
    failed = sweep.failures(found)
    for name, law, steps, message in failed[:SHOWN]:
        text = for_terminal(f"{name} fails {law} at {steps}: {message}")
        lines += fill(text, width, "  ").splitlines()[:2]
    if len(failed) > SHOWN:
        lines.append(f"{len(failed) - SHOWN} more such failures with -v and in the report")
    for table in details if whole else ():
        lines += ["", table.title, *render(table.columns, width).splitlines()]
        lines += ["", *fill(table.note, width).splitlines()] if table.note else []
    return lines


def render_histories(found: Iterable[History], width: int) -> str:
    """Releases over time."""
    return "\n".join(
        _listed(
            f"{one.title}, {len(one.releases)} releases, {one.releases[0]} to {one.releases[-1]}",
            one.sentences(),
            width,
        )
        for one in found
    )


def render_changes(report: GateReport, width: int, limited: bool) -> str:
    """The comparison with a baseline: differences first, then the table, then the verdicts. Where
    limits were given, passing is worth a sentence."""
    columns = changes.columns(report)
    parts = [
        _listed(changes.DIFFERENT, report.differences, width),
        render(columns, width) if columns else "",
        _listed("not compared", report.notes, width),
        "\n".join(fill(f"FAILED {sentence}", width, "  ") for sentence in report.failures),
        changes.passed(report) if limited else "",
    ]
    return for_terminal("\n\n".join(filter(None, parts)))


def _listed(title: str, items: Iterable[str], width: int) -> str:
    lines = [f"  {fill(item, width, '    ')}" for item in items]
    return "\n".join([f"{title}:", *lines]) if lines else ""


def render_tables(found: Sequence[Table], width: int) -> str:
    """Tables of their own, each with its title and how to read it."""
    parts = []
    for table in found:
        title = in_one_line(table.title)
        head = [title, "-" * len(title), *([fill(table.note, width)] if table.note else [])]
        parts.append("\n".join([*head, "", render(table.columns, width)]))
    return for_terminal("\n\n".join(parts))
