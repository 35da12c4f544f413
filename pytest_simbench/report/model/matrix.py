"""Adds what needs tests between rows: what differs, and whether the modes agree."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from pytest_simbench.measure.differences import differences
from pytest_simbench.measure.modes import compare_modes
from pytest_simbench.records.record import Record
from pytest_simbench.records.series import Series, comparable, series
from pytest_simbench.report.model.summary import TaskSummary


def with_differences(
    summaries: Iterable[TaskSummary], records: Sequence[Record]
) -> list[TaskSummary]:
    """The summaries with their `differences`, within a mode and profile, and `modes`.

    Of laws there are none: they are no sample of anything, see `measure.phenomena`.

    Args:
        summaries: from `summary.summarise`.
        records: that they were made of.
    """
    return [
        summary if summary.phenomenon else _compared(summary, series(_of(summary, records)))
        for summary in summaries
    ]


def _of(summary: TaskSummary, records: Sequence[Record]) -> list[Record]:
    return [record for record in records if record.task == summary.task]


def _compared(summary: TaskSummary, rows: Sequence[Series]) -> TaskSummary:
    """Rows are in the summary's order."""
    found = differences(
        {place: row.records for place, row in enumerate(rows)},
        summary.metrics,
        lambda a, b: comparable(rows[a], rows[b]),
        summary.references,
    )
    own = [record for row in rows for record in row.records]
    modes = tuple(c.sentence for c in compare_modes(own, summary.metrics))
    return replace(summary, differences=tuple(found), modes=modes)
