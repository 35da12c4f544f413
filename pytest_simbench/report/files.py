"""The report in the run folder: `report.html`, `replay.html` of its traces, `report.md`,
`report.csv` and, where matplotlib is, pictures."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TextIO

from pytest_simbench.ground.text import for_csv, for_terminal
from pytest_simbench.measure.sweep import Swept
from pytest_simbench.records.folder import Reading, RunFolder
from pytest_simbench.records.metrics import COSTS
from pytest_simbench.records.paths import write_whole
from pytest_simbench.records.record import Record
from pytest_simbench.report.figures.sheet import sheet_name
from pytest_simbench.report.figures.sheet import sheets as sheets_of
from pytest_simbench.report.figures.task import FiguresUnavailable, write_figures
from pytest_simbench.report.markdown import run as markdown
from pytest_simbench.report.markdown.badge import badge
from pytest_simbench.report.model import history, sweep
from pytest_simbench.report.model import outcome as outcome_of
from pytest_simbench.report.model.claims import Claims, claims_of
from pytest_simbench.report.model.history import AnyHistory
from pytest_simbench.report.model.matrix import with_differences
from pytest_simbench.report.model.outcome import Outcome
from pytest_simbench.report.model.summary import PHASES, TaskSummary, at_own_steps, summarise
from pytest_simbench.report.model.truth import others
from pytest_simbench.report.page import PAGE_NAME, Compared
from pytest_simbench.report.replay import REPLAY_NAME
from pytest_simbench.report.replay.groups import Group, groups
from pytest_simbench.worker.text import named

MARKDOWN_NAME = "report.md"
CSV_NAME = "report.csv"

IDENTITY = (
    "test", "task", "simulator", "mode", "profile", "protocol", "repetition", "seed", "jitter",
    "attempt", "status", "contended", "reused_worker",
)  # fmt: skip


@dataclass(frozen=True)
class Written:
    """What became of the report.

    Attributes:
        problems: one sentence each.
        complete: whether every file was written; pictures that need matplotlib are not missed.
        summaries: what the report tells of each task.
        histories: of simulators of which there are several releases.
        sweeps: laws over time steps.
        claims: what the tests claimed, and what came of it.
    """

    problems: tuple[str, ...] = ()
    complete: bool = True
    summaries: tuple[TaskSummary, ...] = ()
    histories: tuple[AnyHistory, ...] = ()
    sweeps: tuple[Swept, ...] = ()
    claims: Claims | None = None


def write_report(
    folder: RunFolder,
    reading: Reading | None = None,
    comparison: Compared | None = None,
    looks: int = 1,
) -> Written:
    """Write all files from what a run folder holds, into it.

    Args:
        folder: of the run.
        reading: of it, where it has been read already.
        comparison: with a baseline, where there is one.
        looks: how often the run was judged, see `outcome.Outcome`.

    Raises:
        RecordError: its records cannot be read.
    """
    reading = reading or folder.read()
    records = in_order(reading.records)
    summaries = summaries_of(reading, looks)
    histories, sweeps = tuple(history.of_run(reading)), tuple(sweep.of_run(reading))
    claims = claims_of(reading, comparison[1] if comparison else None)
    written = write_files(
        folder.path,
        summaries,
        records,
        comparison=comparison,
        histories=histories,
        sweeps=sweeps,
        claims=claims,
    )
    return replace(
        written, summaries=tuple(summaries), histories=histories, sweeps=sweeps, claims=claims
    )


def summaries_of(reading: Reading, looks: int = 1) -> list[TaskSummary]:
    """What a run that was judged so often tells of each task."""
    records = at_own_steps(in_order(reading.records))
    found = summarise(records, reading.metrics, reading.references)
    return with_differences([replace(summary, looks=looks) for summary in found], records)


def in_order(records: Sequence[Record]) -> list[Record]:
    """By test and repetition, however many processes wrote them."""
    return sorted(records, key=lambda r: (r.test, r.repetition))


def write_files(
    folder: Path,
    summaries: Sequence[TaskSummary],
    records: Sequence[Record],
    figures: bool = True,
    comparison: Compared | None = None,
    run: Path | None = None,
    histories: Sequence[AnyHistory] = (),
    sweeps: Sequence[Swept] = (),
    claims: Claims | None = None,
) -> Written:
    """Write all files; what cannot be written is told, and the rest is written all the same.

    Args:
        folder: where.
        summaries: of each task.
        records: that they were made of.
        figures: whether pictures are drawn too.
        comparison: with a baseline, where there is one.
        run: the run folder, where it is another: its results on repeatability are on the page.
        histories: of simulators, drawn too.
        sweeps: laws over time steps, drawn too.
        claims: what the tests claimed, which comes first.
    """
    from pytest_simbench.report.page.context import page
    from pytest_simbench.report.page.render import render  # Jinja2

    problems: list[str] = []
    failed: list[str] = []
    pictures: list[Path] = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        return Written((f"no report: {_unwritable(folder, error)}",), False)
    sheets: Mapping[str, bytes] = {}
    if figures:
        try:
            sheets, told = sheets_of(run or folder, records)
            problems += told
            pictures = [
                *write_figures(folder, others(summaries)),
                *history.write_pictures(folder, histories),
                *sweep.write_pictures(folder, sweeps),
            ]
        except FiguresUnavailable as error:
            problems.append(str(error))
        except OSError as error:
            failed.append(f"pictures: {_unwritable(folder, error)}")
        except Exception as error:  # a fault of ours, which costs the pictures and no table
            failed.append(f"the pictures could not be drawn: {named(error)}")
    told_of = {found.title: found.sentences() for found in histories}
    names = [picture.name for picture in pictures]
    text = markdown.render_run(summaries, names, told_of, sweeps, claims)
    shown, replay, told = _replay(run or folder, records)
    problems += told
    told_page = page(run or folder, summaries, records, comparison, shown, sheets, sweeps, claims)
    contents = {PAGE_NAME: render(told_page)}
    if replay:
        contents[REPLAY_NAME] = replay
    if records:  # else the run has results on repeatability alone
        contents |= {MARKDOWN_NAME: text, CSV_NAME: csv_of(records)}
    encoded = {name: text.encode("utf-8", "replace") for name, text in contents.items()}
    encoded |= {sheet_name(task): sheet for task, sheet in sheets.items()}
    for name, content in encoded.items():
        try:
            write_whole(folder, name, content)
        except OSError as error:
            failed.append(_unwritable(folder / name, error))
    return Written((*problems, *failed), not failed)


def _replay(run: Path, records: Sequence[Record]) -> tuple[list[Group], str, list[str]]:
    """What the replay shows, the page itself, and what could not be shown."""
    from pytest_simbench.report.replay.render import ReplayUnavailable, replay_of

    found = groups(run, records)
    if not found:
        return [], "", []
    try:
        page, count, problems = replay_of(found)
    except ReplayUnavailable as error:
        return [], "", [str(error)]
    return found[:count], page, problems


def where(page: Path, base: Path) -> str:
    """The line that tells where the page is, short where it lies below the folder `base`."""
    return for_terminal(f"report: {shown(page, base)}")


def shown(path: Path, base: Path) -> Path:
    """A path as the terminal shows it: short where it lies below the folder `base`."""
    return path.relative_to(base) if path.is_relative_to(base) else path


def write_outcome(folder: Path, outcome: Outcome) -> str:
    """Keep how a run ended in its folder; a sentence when it could not be written."""
    try:
        outcome.write(folder)
    except OSError as error:
        return _unwritable(folder / outcome_of.NAME, error)
    return ""


def write_badge(path: Path, records: Sequence[Record], passed: bool | None) -> str:
    """Write the badge of a run; a sentence when it could not be written."""
    try:
        write_whole(path.parent, path.name, badge(records, passed).encode("ascii"))
    except OSError as error:
        return f"no badge: {_unwritable(path, error)}"
    return ""


def _unwritable(path: Path, error: OSError) -> str:
    return f"{path} could not be written ({error.strerror or error})"


def csv_of(records: Sequence[Record]) -> str:
    """One line for each repetition; an empty cell where a record has no value.

    Columns: what identifies it, its error, `metrics.<name>`, `cost.<name>` (see
    `records.metrics.COSTS`) and `seconds.<phase>`.
    """
    metrics = list(dict.fromkeys(name for record in records for name in record.metrics))
    file = io.StringIO(newline="")
    writer = CellWriter(file)
    writer.row(
        [
            *IDENTITY,
            *(f"error.{name}" for name in ("type", "phase", "message")),
            *(f"metrics.{name}" for name in metrics),
            *(f"cost.{cost.name}" for cost in COSTS),
            *(f"seconds.{name}" for name in PHASES),
        ]
    )
    for record in records:
        error = record.error
        cells: list[Any] = [getattr(record, name) for name in IDENTITY]
        cells += [error.type, error.phase, error.message] if error else ["", "", ""]
        cells += [record.metrics.get(name) for name in metrics]
        cells += [record.cost(cost.name) for cost in COSTS]
        cells += [record.seconds.get(name) for name in PHASES]
        writer.row(cells)
    return file.getvalue()


class CellWriter:
    """Writes lines of a CSV file in which no text is a formula."""

    def __init__(self, file: TextIO) -> None:
        self._writer = csv.writer(file)

    def row(self, cells: Iterable[Any]) -> None:
        """One line; numbers stay numbers."""
        self._writer.writerow([for_csv(cell) for cell in cells])
