"""The whole result in the terminal, with `-v`: for each task answer, tables, what explains them."""

from __future__ import annotations

from collections.abc import Sequence

from pytest_simbench.ground.text import for_terminal, in_one_line
from pytest_simbench.report.model import tables as columns
from pytest_simbench.report.model import truth
from pytest_simbench.report.model.answer import sentences
from pytest_simbench.report.model.headline import headline
from pytest_simbench.report.model.summary import TaskSummary
from pytest_simbench.report.terminal.grid import fill, render

NARROWEST = 40
"""Tables are laid out for at least so many columns; in fewer, lines run over."""


def render_run(summaries: Sequence[TaskSummary], width: int = 80) -> str:
    """Everything the terminal shows of a run, as plain lines of at most `width` columns.

    No colours and nothing but ASCII of our own, so that any log holds it.

    Args:
        summaries: from `summary.summarise`; without one, the text is empty.
        width: of the terminal; 80 to 140 read well.
    """
    if not summaries:
        return ""
    width = max(width, NARROWEST)
    tasks = truth.others(summaries)
    parts = [truth.whole(summaries, width)] if len(tasks) < len(summaries) else []
    if tasks:
        parts.append("\n".join(fill(sentence, width, "  ") for sentence in headline(tasks)))
    parts += [render_task(summary, width) for summary in tasks]
    parts.append(fill(columns.LEGEND, width))
    deviations = [f"{name}: {text}" for name, text in columns.deviations(summaries)]
    if deviations:
        lines = [f"  {fill(text, width, '    ')}" for text in deviations]
        parts.append("\n".join(["declared deviations from the scene", *lines]))
    return for_terminal("\n\n".join(parts))


def render_task(summary: TaskSummary, width: int = 80) -> str:
    """One task: title, answer, table, failures, further metrics, where the time went."""
    title = in_one_line(columns.title(summary))
    answer = [fill(sentence, width, "  ") for sentence in sentences(summary)]
    parts = ["\n".join([title, "=" * len(title), *answer])]
    parts.append(render(columns.study(summary), width))
    for name, found in columns.details(summary):
        parts.append(in_one_line(f"{summary.task}, {name}") + f"\n{render(found, width)}")
    notes = [fill(f"note: {text}", width, "  ") for text in columns.notes(summary)]
    return "\n\n".join([*parts, "\n".join(notes)] if notes else parts)
