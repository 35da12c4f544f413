"""Adds what needs tests between rows: which beats which, and whether the modes agree."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from pytest_simbench.measure.modes import compare_modes
from pytest_simbench.measure.wins import wins
from pytest_simbench.records.record import Record
from pytest_simbench.records.series import comparable, series
from pytest_simbench.report.summary import TaskSummary


def with_wins(summaries: Iterable[TaskSummary], records: Sequence[Record]) -> list[TaskSummary]:
    """The summaries with their `wins` and `modes`; wins are within a mode and profile.

    Args:
        summaries: from `summary.summarise`.
        records: that they were made of.
    """
    found = []
    for summary in summaries:
        rows = series(r for r in records if r.task == summary.task)  # the summary's order
        result = wins(
            {place: row.records for place, row in enumerate(rows)},
            summary.metrics,
            lambda a, b, rows=rows: comparable(rows[a], rows[b]),  # type: ignore[misc]
        )
        own = [record for row in rows for record in row.records]
        modes = tuple(c.sentence for c in compare_modes(own, summary.metrics))
        found.append(replace(summary, wins=tuple(result), modes=modes))
    return found
