"""The report as GitHub Markdown: for the run folder, docs and the summary page of a CI job."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from pytest_simbench.ground.text import for_markdown, in_one_line
from pytest_simbench.report.model import tables
from pytest_simbench.report.model.claims import Claims
from pytest_simbench.report.model.document import Column, Section, Table, capital
from pytest_simbench.report.model.report import Report
from pytest_simbench.report.model.summary import TaskSummary


def render_run(report: Report, pictures: Sequence[str] = ()) -> str:
    """The whole report, with pictures at addresses relative to it; ends with a newline."""
    if not (report.summaries or report.sweeps):
        return "No repetition was recorded.\n"
    parts = [render_claims(report.claims)] if report.claims else []
    parts += map(render_section, report.sections)
    parts.append(f"How to read it: {for_markdown(tables.LEGEND)}")
    if deviations := tables.deviations(report.summaries):
        lines = _bullets(f"{name}: {text}" for name, text in deviations)
        parts.append(f"## Declared deviations from the scene\n\n{lines}")
    if pictures:
        parts.append("\n".join(["## Pictures", "", *(f"![{name}]({name})" for name in pictures)]))
    return "\n\n".join(parts) + "\n"


def render_claims(found: Claims) -> str:
    """Pass or fail, and why."""
    parts = [f"**{for_markdown(found.sentence)}**", table(found.table.columns)]
    parts.append(for_markdown(found.table.note))
    for trouble in found.troubles:
        told = [f"- {for_markdown(trouble.what)}"]
        told += [f"  worst: {for_markdown(trouble.worst)}"] if trouble.worst else []
        if trouble.again and "`" not in trouble.again:
            told.append(f"  again: `{in_one_line(trouble.again)}`")
        parts.append("<br>\n".join(told))
    if found.more:
        parts.append(f"{found.more} more of them are in the run folder.")
    return "\n\n".join(filter(None, parts))


def render_task(summary: TaskSummary, level: int = 2) -> str:
    """One task under a heading of that level."""
    return render_section(tables.section(summary), level)


def render_section(found: Section, level: int = 2) -> str:
    """A section under a heading of that level: sentences, tables, notes."""
    parts = [f"{'#' * level} {for_markdown(found.title)}", _bullets(found.sentences)]
    for place, each in enumerate(found.tables):
        parts += _titled(each, level + 1 if place else 0)
    parts.append(_bullets(f"note: {text}" for text in found.notes))
    return "\n\n".join(filter(None, parts))


def render_tables(title: str, found: Sequence[Table]) -> str:
    """Tables of their own under one title; ends with a newline."""
    parts = [f"# {title}", *(part for each in found for part in _titled(each, 2))]
    return "\n\n".join(parts) + "\n"


def table(found: Sequence[Column]) -> str:
    """One table with a line for each row; nothing without columns."""
    if not found:
        return ""
    lines = [
        [for_markdown(column.heading, cell=True) for column in found],
        [":--" if column.left else "--:" for column in found],
        *(
            [for_markdown(cell.text, cell=True) for cell in row]
            for row in zip(*(column.cells for column in found), strict=True)
        ),
    ]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _titled(found: Table, level: int) -> list[str]:
    """A table, under a heading where there is a level, and how to read it."""
    heading = [f"{'#' * level} {for_markdown(capital(found.title))}"] if level else []
    return [*heading, table(found.columns), *filter(None, [for_markdown(found.note)])]


def _bullets(items: Iterable[str]) -> str:
    return "\n".join(f"- {for_markdown(item)}" for item in items)
