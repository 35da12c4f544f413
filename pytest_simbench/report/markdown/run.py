"""The same report as GitHub Markdown: for the run folder, docs and the summary page of a CI job."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pytest_simbench.ground.text import for_markdown, in_one_line
from pytest_simbench.measure.sweep import Swept
from pytest_simbench.report.model import sweep, truth
from pytest_simbench.report.model import tables as columns
from pytest_simbench.report.model.answer import sentences
from pytest_simbench.report.model.claims import Claims
from pytest_simbench.report.model.summary import TaskSummary
from pytest_simbench.report.terminal.grid import Column, capital


def render_run(
    summaries: Sequence[TaskSummary],
    pictures: Sequence[str] = (),
    histories: Mapping[str, Sequence[str]] | None = None,
    sweeps: Sequence[Swept] = (),
    claims: Claims | None = None,
) -> str:
    """The whole report; ends with a newline.

    Args:
        summaries: from `summary.summarise`.
        pictures: addresses of pictures to show at the end, relative to the report.
        histories: what changed over a simulator's releases, in sentences, by title.
        sweeps: laws over time steps.
        claims: what the tests claimed, which comes first.
    """
    if not (summaries or sweeps):
        return "No repetition was recorded.\n"
    parts = [render_claims(claims)] if claims else []
    parts += [_truth(summaries)] if truth.laws(summaries) else []
    parts += [_sweep(sweeps)] if sweeps else []
    parts += [render_task(summary) for summary in truth.others(summaries)]
    for title, found in (histories or {}).items():
        items = "\n".join(f"- {for_markdown(text)}" for text in found)
        parts.append(f"## {for_markdown(f'History: {title}')}\n\n{items}")
    parts.append(f"How to read it: {for_markdown(columns.LEGEND)}")
    deviations = columns.deviations(summaries)
    if deviations:
        lines = [f"- {for_markdown(f'{name}: {text}')}" for name, text in deviations]
        parts.append("\n".join(["## Declared deviations from the scene", "", *lines]))
    if pictures:
        parts.append("\n".join(["## Pictures", "", *(f"![{name}]({name})" for name in pictures)]))
    return "\n\n".join(parts) + "\n"


def render_claims(found: Claims) -> str:
    """Pass or fail, and why."""
    parts = [f"**{for_markdown(found.sentence)}**", table(found.table) if found.table else ""]
    for trouble in found.troubles:
        told = [f"- {for_markdown(trouble.what)}"]
        told += [f"  worst: {for_markdown(trouble.worst)}"] if trouble.worst else []
        if trouble.again and "`" not in trouble.again:
            told.append(f"  again: `{in_one_line(trouble.again)}`")
        parts.append("<br>\n".join(told))
    if found.more:
        parts.append(f"{found.more} more of them are in the run folder.")
    return "\n\n".join(filter(None, parts))


def _truth(summaries: Sequence[TaskSummary]) -> str:
    """What simulators make of laws."""
    parts = [f"## {capital(truth.TITLE)}"]
    if told := truth.sentences(summaries):
        parts.append("\n".join(f"- {for_markdown(text)}" for text in told))
    parts += [table(truth.table(summaries)), for_markdown(truth.LEGEND)]
    for name, found in truth.details(summaries):
        parts.append(f"### {for_markdown(capital(name))}\n\n{table(found)}")
    return "\n\n".join(parts)


def _sweep(found: Sequence[Swept]) -> str:
    """Laws over time steps."""
    parts = [f"## {capital(sweep.TITLE)}", table(sweep.table(found)), for_markdown(sweep.LEGEND)]
    parts.append(for_markdown(sweep.READING))
    for name, columns_ in sweep.details(found):
        parts.append(f"### {for_markdown(capital(name))}\n\n{table(columns_)}")
    return "\n\n".join(parts)


def render_task(summary: TaskSummary, level: int = 2) -> str:
    """One task under a heading of that level."""
    title = f"{'#' * level} {for_markdown(columns.title(summary))}"
    parts = [title, "\n".join(f"- {for_markdown(text)}" for text in sentences(summary))]
    parts.append(table(columns.study(summary)))
    tables = [*columns.details(summary), (columns.BY_PHASE, columns.by_phase(summary))]
    for name, found in tables:
        if found:
            heading = for_markdown(capital(name))
            parts.append(f"{'#' * (level + 1)} {heading}\n\n{table(found)}")
    notes = columns.notes(summary)
    if notes:
        parts.append("\n".join(f"- {for_markdown(f'note: {text}')}" for text in notes))
    return "\n\n".join(part for part in parts if part)


def table(found: Sequence[Column]) -> str:
    """One table with a line for each row."""
    single = [column.joined() for column in found]
    lines = [
        [for_markdown(column.heading, cell=True) for column in single],
        [":--" if column.left else "--:" for column in single],
        *(
            [for_markdown(" ".join(cell), cell=True) for cell in row]
            for row in zip(*(column.cells for column in single), strict=True)
        ),
    ]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
