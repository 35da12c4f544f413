"""Adds what needs tests between rows: which beats which, and whether the modes agree."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from pytest_simbench.measure.contest import wins
from pytest_simbench.measure.modes import compare_modes
from pytest_simbench.measure.record import Record
from pytest_simbench.report.summary import TaskSummary, row_key


def with_wins(summaries: Iterable[TaskSummary], records: Sequence[Record]) -> list[TaskSummary]:
    """The summaries with their `wins` and `modes`; wins are within a mode and profile.

    Args:
        summaries: from `summary.summarise`.
        records: that they were made of.
    """
    found = []
    for summary in summaries:
        groups: dict[tuple[str, ...], list[Record]] = {}
        for record in sorted(
            (r for r in records if r.task == summary.task), key=lambda r: (row_key(r), r.repetition)
        ):
            groups.setdefault(row_key(record), []).append(record)
        sides = dict(enumerate(groups.values()))  # the rows' order
        rows = summary.rows
        result = wins(
            sides,
            summary.metrics,
            lambda a, b, rows=rows: (  # type: ignore[misc]
                (rows[a].mode, rows[a].profile, rows[a].test)
                == (rows[b].mode, rows[b].profile, rows[b].test)
            ),
        )
        own = [record for group in groups.values() for record in group]
        modes = tuple(c.sentence for c in compare_modes(own, summary.metrics))
        found.append(replace(summary, wins=tuple(result), modes=modes))
    return found
