"""`report.html`: one file that a browser opens offline, made from a run folder's records.

Modules: `context` (what the page tells), `cells` (its tables), `strips` (a dot for each
repetition), `pictures` (matplotlib's, as SVG), `render` (HTML). Jinja2 is imported only when a page
is written.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from pytest_simbench.measure.gate import GateReport
from pytest_simbench.measure.sweep import Swept
from pytest_simbench.records.record import Record
from pytest_simbench.report.replay.groups import Group
from pytest_simbench.report.summary import TaskSummary

PAGE_NAME = "report.html"

Compared = tuple[str, GateReport]
"""Name of a baseline, and what differs from it."""


def page_of(
    folder: Path,
    summaries: Sequence[TaskSummary],
    records: Sequence[Record],
    comparison: Compared | None = None,
    replays: Sequence[Group] = (),
    sheets: Mapping[str, bytes] | None = None,
    sweeps: Sequence[Swept] = (),
) -> str:
    """The page of a run, as HTML.

    Args:
        folder: of the run; its results on repeatability are read from it.
        summaries: from `summary.summarise`, with their wins.
        records: that they were made of.
        comparison: with a baseline, where there is one.
        replays: what the replay beside the page shows.
        sheets: contact sheets (PNG), by the name of their task.
        sweeps: laws over time steps.
    """
    from pytest_simbench.report.page.context import page
    from pytest_simbench.report.page.render import render

    return render(page(folder, summaries, records, comparison, replays, sheets or {}, sweeps))
