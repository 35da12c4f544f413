"""What the page tells, ready for its template; a function of what a run folder holds."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path
from typing import Any

from pytest_simbench.ground.text import for_terminal
from pytest_simbench.records.record import Record, Who
from pytest_simbench.report.figures import sweep as sweep_figures
from pytest_simbench.report.figures import task as task_figures
from pytest_simbench.report.figures import transfer as transfer_figures
from pytest_simbench.report.model import (
    carried,
    cells,
    changes,
    repeatability,
    sweep,
    tables,
    transfer,
    truth,
)
from pytest_simbench.report.model.answer import headline
from pytest_simbench.report.model.claims import command
from pytest_simbench.report.model.report import Report
from pytest_simbench.report.model.summary import Cause, Row, TaskSummary
from pytest_simbench.report.page.pictures import drawn
from pytest_simbench.report.page.setup import setup
from pytest_simbench.report.page.strips import strips
from pytest_simbench.report.replay.recorded import Group, links, videos

TAIL = 30
"""Lines of a log that are shown."""

Shown = dict[str, Any]
"""What a part of the template shows, by the names that it has there."""


def page(
    folder: Path,
    report: Report,
    replays: Sequence[Group] = (),
    sheets: Mapping[str, bytes] | None = None,
) -> Shown:
    """What the page of a run tells, also of its results on repeatability, of the replay beside it,
    and contact sheets (PNG) by task; `render.render` makes HTML of it."""
    summaries, tasks = report.summaries, report.tasks
    repetitions = _Repetitions(folder, replays)
    of_tasks = [drawn(task_figures.on_page(summary)) for summary in tasks]
    swept, problem = drawn(sweep_figures.pictures(report.sweeps))
    ranks, _ = drawn(transfer_figures.pictures(report.transfers))
    transfers = [transfer.section(found) for found in report.transfers]
    again, problems = repeatability.found_in(folder)
    laws = len(truth.laws(summaries))
    subjects = [f"{laws} law{'s' * (laws > 1)}"] * bool(laws) + [found.task for found in tasks]
    rows = [row.of for summary in summaries for row in summary.rows]
    choices = {name: list(dict.fromkeys(getattr(of, name) for of in rows)) for name in Who._fields}
    return {
        "claims": report.claims,
        "title": " and ".join(subjects) or ("time steps" if report.sweeps else "repeatability"),
        "answer": [
            *(sentence for told in [*report.scenes, *transfers] for sentence in told.sentences),
            *truth.sentences(summaries),
            *headline(tasks),
        ],
        # What could not be shown, each once.
        "problems": dict.fromkeys(
            filter(None, [*(why for _, why in of_tasks), *problems, problem])
        ),
        "filters": {name: found for name, found in choices.items() if len(found) > 1},
        "scenes": report.scenes,
        "transfers": list(zip_longest(transfers, ranks)),
        "carried": carried.sections(folder),
        "truth": truth.section(summaries),
        "sweep": sweep.section(report.sweeps),
        "swept": swept,
        "tasks": [
            _task(summary, repetitions, replays)
            | {
                "pictures": pictures,
                "sheet": b64encode((sheets or {}).get(summary.task, b"")).decode("ascii"),
            }
            for summary, (pictures, _) in zip(tasks, of_tasks, strict=True)
        ],
        "repeatability": again,
        "comparison": report.comparison and changes.section(*report.comparison, limited=False),
        "setup": setup(summaries),
        "repetitions": repetitions.shown,
    }


class _Repetitions:
    """The page's repetitions, each put there when its number is first asked for.

    Attributes:
        shown: of all tasks, as plain data, in the order of the dots' numbers.
        replay: the address of a replay, by `id(record)`; `video` gives that of a video.
    """

    def __init__(self, folder: Path, replays: Sequence[Group]) -> None:
        self.shown: list[Shown] = []
        self.replay, self.video = links(replays), videos(folder)
        self._numbers: dict[int, int] = {}

    def number(self, record: Record) -> int:
        if id(record) not in self._numbers:
            self._numbers[id(record)] = len(self.shown)
            self.shown.append(_repetition(record) | self.recorded(record))
        return self._numbers[id(record)]

    def recorded(self, record: Record) -> Shown:
        """The addresses of its replay and video."""
        return {"replay": self.replay.get(id(record), ""), "video": self.video(record)}


def _task(summary: TaskSummary, repetitions: _Repetitions, replays: Sequence[Group]) -> Shown:
    """One task; failures are `causes` in place of a table, of replays and videos there is what each
    shows, and the address."""
    told = tables.section(summary, cells.mean_first)
    groups = [group for group in replays if group.task == summary.task]
    records = [record for row in summary.rows for record in row.records]
    return {
        "told": replace(told, tables=[t for t in told.tables if t.title != tables.CRASHES]),
        "strips": strips(summary, repetitions.number),
        "causes": [_cause(row, cause, repetitions) for row in summary.rows for cause in row.causes],
        "replays": [
            (f"seed {g.seed}, {_simulators(g)}", repetitions.replay[id(g.shown[0][0])])
            for g in groups
        ],
        "videos": [
            (f"{r.label}, seed {r.seed}", at) for r in records if (at := repetitions.video(r))
        ],
    }


def _cause(row: Row, cause: Cause, repetitions: _Repetitions) -> Shown:
    """Failures of a row that share type and phase, with the end of the first one's log."""
    return {
        "title": f"{row.label}: {cause.told}",
        "of": row.of,
        "message": cause.message,
        "repetitions": tables.numbers(cause.repetitions, 10),
        "log": cause.log,
        "tail": for_terminal("\n".join(cause.tail[-TAIL:])),
        **repetitions.recorded(cause.records[0]),
    }


def _simulators(group: Group) -> str:
    count = len(group.shown)
    return group.shown[0][0].simulator if count == 1 else f"{count} side by side"


def _repetition(record: Record) -> Shown:
    """What a dot tells of its repetition."""
    error = record.error
    found = {
        "of": record.label,
        "task": record.task,
        "repetition": record.repetition,
        "seed": str(record.seed),  # JavaScript keeps 53 bits of a number
        "status": record.status,
        "cause": f"{error.cause}: {error.message}" if error else "; ".join(record.reasons),
        "log": record.notes.log,
        "command": command(record),
    }
    return {k: for_terminal(v) if isinstance(v, str) else v for k, v in found.items()}
