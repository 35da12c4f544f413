"""The result of a run in the terminal: the short one, and with `-v` the whole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pytest_simbench.ground.text import for_terminal, in_one_line
from pytest_simbench.report.model import tables, truth
from pytest_simbench.report.model.answer import headline
from pytest_simbench.report.model.document import Section
from pytest_simbench.report.model.summary import TaskSummary
from pytest_simbench.report.terminal.grid import fill, fits, fits_below, render

NARROWEST = 40
"""Tables are laid out for at least so many columns; in fewer, lines run over."""

MOST_LINES = 38
"""For the short result; two further ones tell its title and where the report is. Rows are never
left out, only warnings."""

LEAST_ROOM = 3
"""Lines for warnings, however many rows there are."""

LONGEST_WARNING = 2
"""Lines of one warning; the rest of it is in the report."""


def render_run(summaries: Sequence[TaskSummary], width: int = 80) -> str:
    """Everything the terminal shows of a run, as plain lines of at most `width` columns.

    No colours and nothing but ASCII of our own, so that any log holds it. 80 to 140 columns read
    well. Without a summary the text is empty.
    """
    if not summaries:
        return ""
    width = max(width, NARROWEST)
    tasks, laws = truth.others(summaries), truth.section(summaries)
    parts = [render_section(laws, width, titled=False)] if laws else []
    if tasks:
        parts.append("\n".join(fill(sentence, width, "  ") for sentence in headline(tasks)))
    parts += [render_task(summary, width) for summary in tasks]
    parts.append(fill(tables.LEGEND, width))
    deviations = [f"{name}: {text}" for name, text in tables.deviations(summaries)]
    if deviations:
        lines = [f"  {fill(text, width, '    ')}" for text in deviations]
        parts.append("\n".join(["declared deviations from the scene", *lines]))
    return for_terminal("\n\n".join(parts))


def render_task(summary: TaskSummary, width: int = 80) -> str:
    """One task: title, answer, table, failures, further metrics, where the time went."""
    found = tables.section(summary)
    narrow = [table for table in found.tables if table.title != tables.BY_PHASE]
    return render_section(replace(found, tables=narrow), width)


def render_section(found: Section, width: int, *, titled: bool = True) -> str:
    """A section: title, sentences, tables with what says how to read them, notes."""
    title = in_one_line(found.title)
    head = [title, "=" * len(title)] if titled else []
    parts = ["\n".join([*head, *(fill(text, width, "  ") for text in found.sentences)])]
    for place, table in enumerate(found.tables):
        name = in_one_line(", ".join(filter(None, [found.of, table.title])))
        parts.append(f"{name}\n" * (place > 0) + render(table.columns, width))
        parts.append(fill(table.note, width))
    parts.append("\n".join(fill(f"note: {text}", width, "  ") for text in found.notes))
    return "\n\n".join(filter(None, parts))


def render_brief(summaries: Sequence[TaskSummary], width: int) -> str:
    """The answer, a line for each row, and warnings, as plain lines of at most `width` columns;
    empty without a task. Everything else is in the report, and in the terminal with `-v`."""
    if not summaries:
        return ""
    width = max(width, NARROWEST)
    tasks, laws = truth.others(summaries), truth.section(summaries)
    parts = []
    if laws:
        parts.append(render_section(replace(laws, tables=laws.tables[:1]), width, titled=False))
    parts.append("\n".join(fill(sentence, width, "  ") for sentence in headline(tasks)))
    for summary in tasks:
        title, columns = fill(in_one_line(tables.title(summary)), width), tables.brief(summary)
        long = not fits(columns[:1], width // 2)  # such names stand above their rows
        fit = fits_below if long else fits
        while len(columns) > 2 and not fit(columns, width):
            columns.pop()  # the least important ones come last
        parts.append(f"{title}\n{render(columns, width)}")
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
    more = f"{len(found) - len(shown)} more warnings with -v and in the report"
    return "\n".join([*shown, more])


def _short(text: str, width: int) -> list[str]:
    lines = fill(in_one_line(text), width, "  ").split("\n")
    if len(lines) > LONGEST_WARNING:
        lines[LONGEST_WARNING - 1] = f"{lines[LONGEST_WARNING - 1][: width - 4]} ..."
    return lines[:LONGEST_WARNING]


def warnings(summaries: Sequence[TaskSummary]) -> list[str]:
    """Crashes by cause, then what a reader must know of the rows, those of one text together."""
    crashed = [
        f"CRASHED {summary.task}, {row.label}: {cause.told}: {cause.message}"
        for summary in summaries
        for row in summary.rows
        for cause in row.causes
    ]
    notes: dict[str, list[str]] = {}
    for summary in summaries:
        for name, row in zip(summary.names, summary.rows, strict=True):
            for text in row.notes:
                notes.setdefault(text, []).append(name)
    every = {name for summary in summaries for name in summary.names}
    told = [
        f"note: {summary.task}: {text}" for summary in summaries for text in tables.of_run(summary)
    ]
    for text, names in notes.items():
        of = dict.fromkeys(names)
        told.append(f"note: {'all' if every <= of.keys() else ', '.join(of)}: {text}")
    return crashed + told
