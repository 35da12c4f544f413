"""The report in the run folder: `report.html`, `replay.html` of its traces, `report.md`,
`report.csv` and, where matplotlib is, pictures."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import Any, TextIO

from pytest_simbench.ground.text import for_csv, for_terminal
from pytest_simbench.measure.sweep import Swept
from pytest_simbench.records.folder import Reading, RunFolder
from pytest_simbench.records.metrics import COSTS
from pytest_simbench.records.paths import write_whole
from pytest_simbench.records.record import Record
from pytest_simbench.report.markdown.badge import badge
from pytest_simbench.report.markdown.run import render_run, render_tables
from pytest_simbench.report.model import history, sweep, truth
from pytest_simbench.report.model.claims import Claims, claims_of
from pytest_simbench.report.model.document import Table
from pytest_simbench.report.model.history import AnyHistory
from pytest_simbench.report.model.outcome import NAME as OUTCOME
from pytest_simbench.report.model.outcome import Compared, Outcome
from pytest_simbench.report.model.summary import PHASES, TaskSummary, at_own_steps, summarise
from pytest_simbench.report.page import PAGE_NAME
from pytest_simbench.report.replay import REPLAY_NAME
from pytest_simbench.report.replay.groups import Group, groups
from pytest_simbench.worker.text import named

MARKDOWN_NAME = "report.md"
CSV_NAME = "report.csv"
TABLES_NAME = "repeatability.md"

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
    found: dict[str, Any] = {
        "histories": tuple(history.of_run(reading)),
        "sweeps": tuple(sweep.of_run(reading)),
        "claims": claims_of(reading, comparison[1] if comparison else None),
    }
    summaries = tuple(summaries_of(reading, looks))
    records = in_order(reading.records)
    written = write_files(folder.path, summaries, records, comparison=comparison, **found)
    return replace(written, summaries=summaries, **found)


def summaries_of(reading: Reading, looks: int = 1) -> list[TaskSummary]:
    """What a run that was judged so often tells of each task."""
    records = at_own_steps(in_order(reading.records))
    found = summarise(records, reading.metrics, reading.references)
    return [replace(summary, looks=looks) for summary in found]


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

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        return Written((f"no report: {_unwritable(folder, error)}",), False)
    drawn = _Drawn()
    if figures:
        drawn = _draw(folder, run or folder, summaries, records, histories, sweeps)
    told = history.sections(histories)
    text = render_run(summaries, drawn.pictures, told, sweeps, claims)
    shown, replay, unshown = _replay(run or folder, records)
    found = page(run or folder, summaries, comparison, shown, drawn.sheets, sweeps, claims)
    contents = {PAGE_NAME: render(found)}
    if replay:
        contents[REPLAY_NAME] = replay
    if records:  # else the run has results on repeatability alone
        contents |= {MARKDOWN_NAME: text, CSV_NAME: csv_of(records)}
    unwritten = [_written(folder, name, text) for name, text in contents.items()]
    unwritten += [_written(folder, name, sheet) for name, sheet in drawn.files.items()]
    failed = [*drawn.failed, *filter(None, unwritten)]
    return Written((*drawn.problems, *unshown, *failed), not failed)


@dataclass
class _Drawn:
    """Pictures of a run.

    Attributes:
        pictures: names of the files written.
        sheets: contact sheets (PNG), by the name of their task; `files`: by that of their file.
        problems, failed: what could not be shown, and what went wrong, as sentences.
    """

    pictures: list[str] = field(default_factory=list)
    sheets: Mapping[str, bytes] = field(default_factory=dict)
    files: Mapping[str, bytes] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)


def _draw(
    folder: Path,
    run: Path,
    summaries: Sequence[TaskSummary],
    records: Sequence[Record],
    histories: Sequence[AnyHistory],
    sweeps: Sequence[Swept],
) -> _Drawn:
    """Draw all pictures, and write those that are no contact sheet."""
    from pytest_simbench.report.figures import history, sheet, sweep, task
    from pytest_simbench.report.figures.drawing import FiguresUnavailable, write

    found = _Drawn()
    try:
        found.sheets, found.problems = sheet.sheets(run, records)
        found.files = {sheet.sheet_name(task): drawn for task, drawn in found.sheets.items()}
        every = task.pictures(truth.others(summaries)), history.pictures(histories)
        paths = write(folder, chain(*every, sweep.pictures(sweeps)))
        found.pictures = [path.name for path in paths]
    except FiguresUnavailable as error:
        found.problems.append(str(error))
    except OSError as error:
        found.failed.append(f"pictures: {_unwritable(folder, error)}")
    except Exception as error:  # a fault of ours, which costs the pictures and no table
        found.failed.append(f"the pictures could not be drawn: {named(error)}")
    return found


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
        return _unwritable(folder / OUTCOME, error)
    return ""


def write_badge(path: Path, records: Sequence[Record], passed: bool | None) -> str:
    """Write the badge of a run; a sentence when it could not be written."""
    failed = _written(path.parent, path.name, badge(records, passed))
    return f"no badge: {failed}" if failed else ""


def write_tables(folder: Path, to: Path | None = None) -> tuple[list[Table], list[str]]:
    """The tables of what a run folder holds on repeatability, also as a file of Markdown.

    Args:
        folder: of the run.
        to: the folder for the file; None: there is none.

    Returns:
        The tables, and one sentence for each thing that is wrong.
    """
    from pytest_simbench.report.model.repeatability import found_in

    found, problems = found_in(folder)
    if found and to is not None:
        problems.append(_written(to, TABLES_NAME, render_tables("Repeatability", found)))
    return found, [*filter(None, problems)]


def _written(folder: Path, name: str, content: str | bytes) -> str:
    """Write a file; a sentence when it could not be written."""
    encoded = content.encode("utf-8", "replace") if isinstance(content, str) else content
    try:
        write_whole(folder, name, encoded)
    except OSError as error:
        return _unwritable(folder / name, error)
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
