"""What the page tells, ready for its template; a function of what a run folder holds."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from pytest_simbench.ground.text import for_terminal
from pytest_simbench.measure.sweep import Swept
from pytest_simbench.records.record import Record
from pytest_simbench.report.model import cells, changes, repeatability, sweep, tables, truth
from pytest_simbench.report.model.again import command
from pytest_simbench.report.model.answer import headline
from pytest_simbench.report.model.claims import Claims
from pytest_simbench.report.model.document import Of, Section, Table
from pytest_simbench.report.model.outcome import Compared
from pytest_simbench.report.model.recorded import videos
from pytest_simbench.report.model.summary import TaskSummary
from pytest_simbench.report.page.pictures import Picture, of_sweeps, pictures
from pytest_simbench.report.page.setup import Setup, setup
from pytest_simbench.report.page.strips import Strip, strips
from pytest_simbench.report.replay.groups import Group, links

TAIL = 30
"""Lines of a log that are shown."""

Address = Callable[[Record], str]


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
    """One task.

    Attributes:
        told: its sentences, tables and notes; failures are `causes` in place of a table.
        replays, videos: of each what it shows, and the address.
        sheet: the contact sheet, as base64.
    """

    told: Section
    strips: Sequence[Strip]
    causes: Sequence[FailureBlock]
    pictures: Sequence[Picture]
    replays: Sequence[tuple[str, str]]
    videos: Sequence[tuple[str, str]]
    sheet: str


@dataclass
class _Repetitions:
    """The page's repetitions as plain data, each put there when its number is first asked for."""

    replay: Mapping[int, str]
    video: Address
    shown: list[dict[str, Any]] = field(default_factory=list)
    _numbers: dict[int, int] = field(default_factory=dict)

    def number(self, record: Record) -> int:
        if id(record) not in self._numbers:
            self._numbers[id(record)] = len(self.shown)
            self.shown.append(_repetition(record, *self.recorded(record)))
        return self._numbers[id(record)]

    def recorded(self, record: Record) -> tuple[str, str]:
        """The addresses of its replay and video."""
        return self.replay.get(id(record), ""), self.video(record)


@dataclass(frozen=True)
class Page:
    """Everything.

    Attributes:
        filters: the choices by what they choose; of one there is none.
        truth, sweep: of laws, the table of phenomena first; None where none ran.
        swept: pictures of laws over time steps.
        comparison: with a baseline, and `changed`, its table.
        repetitions: of all tasks, as plain data, in the order of the dots' numbers.
        problems: what could not be shown, as sentences.
        claims: pass or fail, and why, which comes first.
    """

    title: str
    answer: Sequence[str]
    filters: Mapping[str, Sequence[str]]
    truth: Section | None
    sweep: Section | None
    swept: Sequence[Picture]
    tasks: Sequence[TaskPart]
    repeatability: Sequence[Table]
    comparison: Compared | None
    changed: Table | None
    setup: Setup
    repetitions: Sequence[Mapping[str, Any]]
    problems: Sequence[str]
    claims: Claims | None = None


def page(
    folder: Path,
    summaries: Sequence[TaskSummary],
    comparison: Compared | None = None,
    replays: Sequence[Group] = (),
    sheets: Mapping[str, bytes] | None = None,
    sweeps: Sequence[Swept] = (),
    claims: Claims | None = None,
) -> Page:
    """What the page of a run tells; `render.render` makes HTML of it.

    Args:
        folder: of the run; its results on repeatability are read from it.
        summaries: from `summary.summarise`.
        comparison: with a baseline, where there is one.
        replays: what the replay beside the page shows.
        sheets: contact sheets (PNG), by the name of their task.
        sweeps: laws over time steps.
        claims: what the tests claimed.
    """
    repetitions = _Repetitions(links(replays), videos(folder))
    problems: dict[str, None] = {}
    tasks = []
    for summary in truth.others(summaries):
        drawn, problem = pictures(summary)
        problems |= dict.fromkeys(filter(None, [problem]))
        sheet = b64encode((sheets or {}).get(summary.task, b"")).decode("ascii")
        tasks.append(_task(summary, repetitions, replays, drawn, sheet))
    again, unreadable = repeatability.found_in(folder)
    swept, problem = of_sweeps(sweeps)
    problems |= dict.fromkeys(filter(None, [*unreadable, problem]))
    rows = [row.of for summary in summaries for row in summary.rows]
    choices = {name: list(dict.fromkeys(getattr(of, name) for of in rows)) for name in Of._fields}
    changed = changes.columns(comparison[1]) if comparison else []
    laws = len(truth.laws(summaries))
    told = [f"{laws} law{'s' * (laws > 1)}"] * bool(laws) + [part.told.of for part in tasks]
    return Page(
        " and ".join(told) or ("time steps" if sweeps else "repeatability"),
        [*truth.sentences(summaries), *headline(truth.others(summaries))],
        {name: found for name, found in choices.items() if len(found) > 1},
        truth.section(summaries),
        sweep.section(sweeps),
        swept,
        tasks,
        again,
        comparison,
        Table("Changes", changed) if changed else None,
        setup(summaries),
        repetitions.shown,
        list(problems),
        claims,
    )


def _task(
    summary: TaskSummary,
    repetitions: _Repetitions,
    replays: Sequence[Group],
    drawn: Sequence[Picture],
    sheet: str,
) -> TaskPart:
    told = tables.section(summary, cells.mean_first)
    shown = [table for table in told.tables if table.title != tables.CRASHES]
    groups = [group for group in replays if group.task == summary.task]
    records = [record for row in summary.rows for record in row.records]
    return TaskPart(
        replace(told, tables=shown),
        strips(summary, repetitions.number),
        _causes(summary, repetitions.recorded),
        drawn,
        [
            (f"seed {g.seed}, {_simulators(g)}", repetitions.replay[id(g.shown[0][0])])
            for g in groups
        ],
        [(f"{r.label}, seed {r.seed}", at) for r in records if (at := repetitions.video(r))],
        sheet,
    )


def _causes(
    summary: TaskSummary, recorded: Callable[[Record], tuple[str, str]]
) -> list[FailureBlock]:
    """Of each row; `recorded` gives the addresses of a repetition's replay and video."""
    found = []
    for row in summary.rows:
        for cause in row.causes:
            first = next(r for r in row.records if r.repetition == cause.repetitions[0])
            tail = first.error.log_tail.strip().splitlines() if first.error else []
            where = f" in {cause.phase}" if cause.phase else ""
            found.append(
                FailureBlock(
                    f"{row.label}: {len(cause.repetitions)} x {cause.type}{where}",
                    row.of,
                    cause.message,
                    tables.numbers(cause.repetitions, 10),
                    cause.log,
                    for_terminal("\n".join(tail[-TAIL:])),
                    *recorded(first),
                )
            )
    return found


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
