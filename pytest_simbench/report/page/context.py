"""What the page tells, ready for its template; a function of what a run folder holds."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pytest_simbench.ground.text import for_terminal
from pytest_simbench.records.record import Record
from pytest_simbench.records.series import series
from pytest_simbench.report.model import repeatability, sweep, truth
from pytest_simbench.report.model import tables as columns
from pytest_simbench.report.model.again import command
from pytest_simbench.report.model.answer import sentences
from pytest_simbench.report.model.changes import DIFFERENT
from pytest_simbench.report.model.changes import columns as change_columns
from pytest_simbench.report.model.claims import Claims
from pytest_simbench.report.model.headline import headline
from pytest_simbench.report.model.recorded import videos
from pytest_simbench.report.model.summary import TaskSummary, at_own_steps
from pytest_simbench.report.page import Compared as Reported
from pytest_simbench.report.page import setup
from pytest_simbench.report.page.cells import Of, Table, from_columns, labelled, of, study
from pytest_simbench.report.page.pictures import Picture, of_sweeps, pictures
from pytest_simbench.report.page.strips import Strip, strips
from pytest_simbench.report.replay.groups import Group, links

if TYPE_CHECKING:
    from pytest_simbench.measure.gate import GateReport
    from pytest_simbench.measure.sweep import Swept

TAIL = 30
"""Lines of a log that are shown."""


@dataclass(frozen=True)
class FailureBlock:
    """Failures of one row that share type and phase, with the end of the first one's log."""

    title: str
    of: Of
    message: str
    repetitions: str
    log: str
    tail: str
    replay: str
    video: str


@dataclass(frozen=True)
class TaskPart:
    """One task; of its replays and videos what each shows, and the address; its contact sheet as
    base64."""

    title: str
    answer: Sequence[str]
    study: Table
    strips: Sequence[Strip]
    tables: Sequence[Table]
    causes: Sequence[FailureBlock]
    pictures: Sequence[Picture]
    notes: Sequence[str]
    replays: Sequence[tuple[str, str]]
    videos: Sequence[tuple[str, str]]
    sheet: str


@dataclass(frozen=True)
class Compared:
    """The comparison with a baseline."""

    name: str
    failures: Sequence[str]
    differences: Sequence[str]
    notes: Sequence[str]
    table: Table | None


@dataclass(frozen=True)
class Sweep:
    """Laws over time steps: the table of phenomena first, and pictures."""

    tables: Sequence[Table]
    pictures: Sequence[Picture]
    reading: str


@dataclass(frozen=True)
class Page:
    """Everything. `filters` holds the choices by what they choose; of one there is none.

    Attributes:
        truth: of laws, the table of phenomena first; empty where none ran.
        repetitions: of all tasks, as plain data, in the order of the dots' numbers.
        problems: what could not be shown, as sentences.
        claims: pass or fail, and why, which comes first.
        claimed: its table.
    """

    title: str
    answer: Sequence[str]
    filters: Mapping[str, Sequence[str]]
    truth: Sequence[Table]
    sweep: Sweep | None
    tasks: Sequence[TaskPart]
    repeatability: Sequence[Table]
    comparison: Compared | None
    setup: setup.Setup
    repetitions: Sequence[Mapping[str, Any]]
    problems: Sequence[str]
    claims: Claims | None = None
    claimed: Table | None = None


def page(
    folder: Path,
    summaries: Sequence[TaskSummary],
    records: Sequence[Record],
    comparison: Reported | None = None,
    replays: Sequence[Group] = (),
    sheets: Mapping[str, bytes] | None = None,
    sweeps: Sequence[Swept] = (),
    claims: Claims | None = None,
) -> Page:
    """What the page of a run tells; `render.render` makes HTML of it.

    Args:
        folder: of the run; its results on repeatability are read from it.
        summaries: from `summary.summarise`, with their wins.
        records: that they were made of.
        comparison: with a baseline, where there is one.
        replays: what the replay beside the page shows.
        sheets: contact sheets (PNG), by the name of their task.
        sweeps: laws over time steps.
    """
    records = at_own_steps(records)
    replay, video = links(replays), videos(folder)
    numbers: dict[int, int] = {}
    repetitions: list[dict[str, Any]] = []

    def recorded(record: Record) -> tuple[str, str]:
        """The addresses of its replay and video."""
        return replay.get(id(record), ""), video(record)

    def number(record: Record) -> int:
        """Its place among the page's repetitions, where it is put when first asked for."""
        if id(record) not in numbers:
            numbers[id(record)] = len(repetitions)
            repetitions.append(_repetition(record, *recorded(record)))
        return numbers[id(record)]

    problems: dict[str, None] = {}
    tasks = []
    for summary in truth.others(summaries):
        drawn, problem = pictures(summary)
        rows = [row.records for row in series(r for r in records if r.task == summary.task)]
        problems |= dict.fromkeys(filter(None, [problem]))
        tasks.append(
            TaskPart(
                columns.title(summary),
                sentences(summary),
                study(summary),
                strips(summary, rows, number),
                _tables(summary),
                _causes(summary, rows, recorded),
                drawn,
                columns.notes(summary),
                [
                    (f"seed {group.seed}, {_simulators(group)}", replay[id(group.shown[0][0])])
                    for group in replays
                    if group.task == summary.task
                ],
                [
                    (f"{record.label}, seed {record.seed}", address)
                    for row in rows
                    for record in row
                    if (address := video(record))
                ],
                b64encode((sheets or {}).get(summary.task, b"")).decode("ascii"),
            )
        )
    again, unreadable = repeatability.write_tables(folder)
    problems |= dict.fromkeys(unreadable)
    swept, problem = _sweep(sweeps) if sweeps else (None, "")
    problems |= dict.fromkeys(filter(None, [problem]))
    rows_of = [of(row) for summary in summaries for row in summary.rows]
    choices = {
        name: list(dict.fromkeys(getattr(row, name) for row in rows_of)) for name in Of._fields
    }
    return Page(
        " and ".join(_subjects(summaries)) or ("time steps" if sweeps else "repeatability"),
        [*truth.sentences(summaries), *headline(truth.others(summaries))],
        {name: found for name, found in choices.items() if len(found) > 1},
        _truth(summaries),
        swept,
        tasks,
        [from_columns(title, table, note) for title, note, table in again],
        None if comparison is None else _compared(*comparison),
        setup.setup(summaries, records),
        repetitions,
        list(problems),
        claims,
        from_columns("Claims", claims.table) if claims and claims.table else None,
    )


def _subjects(summaries: Sequence[TaskSummary]) -> list[str]:
    found = truth.laws(summaries)
    laws = [f"{len(found)} law{'s' * (len(found) > 1)}"] if found else []
    return [*laws, *(summary.task for summary in truth.others(summaries))]


def _truth(summaries: Sequence[TaskSummary]) -> list[Table]:
    if not truth.laws(summaries):
        return []
    found = [from_columns(truth.TITLE, truth.table(summaries), truth.LEGEND)]
    return found + [from_columns(name, columns) for name, columns in truth.details(summaries)]


def _sweep(found: Sequence[Swept]) -> tuple[Sweep, str]:
    """And why there are no pictures."""
    shown = [(sweep.TITLE, sweep.table(found), sweep.LEGEND)]
    shown += [(name, table, "") for name, table in sweep.details(found)]
    tables = [from_columns(name, table, note) for name, table, note in shown]
    drawn, problem = of_sweeps(found)
    return Sweep(tables, drawn, sweep.READING), problem


def _tables(summary: TaskSummary) -> list[Table]:
    rows = labelled(summary)
    found = [item for item in columns.details(summary) if item[0] != "crashes"]
    found.append((columns.BY_PHASE, columns.by_phase(summary)))
    return [from_columns(name, table, rows=rows) for name, table in found if table]


def _causes(
    summary: TaskSummary,
    rows: Sequence[Sequence[Record]],
    recorded: Callable[[Record], tuple[str, str]],
) -> list[FailureBlock]:
    """Of each row; `recorded` gives the addresses of a repetition's replay and video."""
    found = []
    for row, records in zip(summary.rows, rows, strict=True):
        for cause in row.causes:
            first = next(r for r in records if r.repetition == cause.repetitions[0])
            tail = first.error.log_tail.strip().splitlines() if first.error else []
            many = len(cause.repetitions)
            where = f" in {cause.phase}" if cause.phase else ""
            found.append(
                FailureBlock(
                    f"{row.label}: {many} x {cause.type}{where}",
                    of(row),
                    cause.message,
                    columns.numbers(cause.repetitions, 10),
                    cause.log,
                    for_terminal("\n".join(tail[-TAIL:])),
                    *recorded(first),
                )
            )
    return found


def _compared(name: str, report: GateReport) -> Compared:
    found = change_columns(report)
    return Compared(
        name,
        [f"FAILED {sentence}" for sentence in report.failures],
        [f"{DIFFERENT}: {sentence}" for sentence in report.differences],
        report.notes,
        from_columns("Changes", found) if found else None,
    )


def _simulators(group: Group) -> str:
    count = len(group.shown)
    return group.shown[0][0].simulator if count == 1 else f"{count} side by side"


def _repetition(record: Record, replay: str, video: str) -> dict[str, Any]:
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
        "replay": replay,
        "video": video,
    }
    return {k: for_terminal(v) if isinstance(v, str) else v for k, v in found.items()}
