"""The report in the run folder: `report.html`, `replay.html` of its traces, `report.md`,
`report.csv` and, where matplotlib is, pictures."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pytest_simbench.ground.text import for_csv, for_terminal
from pytest_simbench.records.claims import Claim
from pytest_simbench.records.configuration import task_parameters
from pytest_simbench.records.metrics import COSTS
from pytest_simbench.records.paths import write_whole
from pytest_simbench.records.record import Record
from pytest_simbench.report.markdown.github import badge
from pytest_simbench.report.markdown.run import render_run, render_tables
from pytest_simbench.report.model.document import Table
from pytest_simbench.report.model.outcome import NAME as OUTCOME
from pytest_simbench.report.model.outcome import RunOutcome
from pytest_simbench.report.model.report import Report
from pytest_simbench.report.model.summary import PHASES
from pytest_simbench.report.page import PAGE_NAME
from pytest_simbench.report.replay import REPLAY_NAME
from pytest_simbench.worker.wire import named

if TYPE_CHECKING:
    from pytest_simbench.report.replay.recorded import Group

MARKDOWN_NAME = "report.md"
CSV_NAME = "report.csv"
TABLES_NAME = "repeatability.md"

IDENTITY = (
    "test", "task", "simulator", "mode", "profile", "protocol", "repetition", "seed", "jitter",
    "attempt", "status", "contended", "reused_worker",
)  # fmt: skip


@dataclass(frozen=True)
class Written(Report):
    """A report, and what became of its files.

    Attributes:
        problems: one sentence each.
        complete: whether every file was written; pictures that need matplotlib are not missed.
    """

    problems: Sequence[str] = ()
    complete: bool = True


def write_files(
    folder: Path, report: Report, run: Path | None = None, figures: bool = True
) -> Written:
    """Write all files; what cannot be written is told, and the rest is written all the same.

    Traces, pictures and results on repeatability are read from the folder of the run, where that is
    another one. Pictures are drawn where `figures` says so.
    """
    from pytest_simbench.report.page.context import page
    from pytest_simbench.report.page.render import render  # Jinja2

    told: list[str] = []
    failed: list[str] = []
    run = run or folder
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        told.append(f"no report: {_unwritable(folder, error)}")
        return Written(**vars(report), problems=told, complete=False)
    drawn, sheets = _draw(folder, run, report, told, failed) if figures else ([], {})
    shown, replay = _replay(run, report.records, told)
    contents: dict[str, str | bytes] = {PAGE_NAME: render(page(run, report, shown, sheets))}
    if replay:
        contents[REPLAY_NAME] = replay
    if report.records:  # else the run has results on repeatability alone
        contents[MARKDOWN_NAME] = render_run(report, drawn)
        contents[CSV_NAME] = csv_of(report.records)
    failed += filter(None, (_written(folder, name, text) for name, text in contents.items()))
    return Written(**vars(report), problems=[*told, *failed], complete=not failed)


def write_page(path: Path, report: Report, run: Path) -> str:
    """Write the page alone, of a run in another folder; a sentence when it could not be written."""
    from pytest_simbench.report.page.context import page
    from pytest_simbench.report.page.render import render

    return _written(path.parent, path.name, render(page(run, report)))


def _draw(
    folder: Path, run: Path, report: Report, told: list[str], failed: list[str]
) -> tuple[list[str], dict[str, bytes]]:
    """Draw and write all pictures; those that simulators made are in the folder of the run. `told`
    and `failed` take what could not be shown, and what went wrong, as sentences.

    Returns:
        Names of the files but contact sheets; and these (PNG), by the name of their task.
    """
    from pytest_simbench.report.figures import history, sheet, sweep, task, transfer
    from pytest_simbench.report.figures.drawing import FiguresUnavailable, write

    sheets: dict[str, bytes] = {}
    try:
        sheets, unread = sheet.sheets(run, report.records)
        told += unread
        for name, drawn in sheets.items():
            failed += filter(None, [_written(folder, sheet.sheet_name(name), drawn)])
        every = task.pictures(report.tasks), history.pictures(report.histories)
        ranks = transfer.pictures(report.transfers)
        paths = write(folder, chain(*every, sweep.pictures(report.sweeps), ranks))
        return [path.name for path in paths], sheets
    except FiguresUnavailable as error:
        told.append(str(error))
    except OSError as error:
        failed.append(f"pictures: {_unwritable(folder, error)}")
    except Exception as error:  # a fault of ours, which costs the pictures and no table
        failed.append(f"the pictures could not be drawn: {named(error)}")
    return [], sheets


def _replay(run: Path, records: Sequence[Record], told: list[str]) -> tuple[list[Group], str]:
    """What the replay shows, and the page itself; `told` takes what could not be shown."""
    from pytest_simbench.report.replay.recorded import groups
    from pytest_simbench.report.replay.render import ReplayUnavailable, replay_of

    found = groups(run, records)
    try:
        page, count, problems = replay_of(found) if found else ("", 0, [])
    except ReplayUnavailable as error:
        page, count, problems = "", 0, [str(error)]
    told += problems
    return found[:count], page


def where(page: Path, base: Path) -> str:
    """The line that tells where the page is, short where it lies below the folder `base`."""
    return for_terminal(f"report: {shown(page, base)}")


def shown(path: Path, base: Path) -> Path:
    """A path as the terminal shows it: short where it lies below the folder `base`."""
    return path.relative_to(base) if path.is_relative_to(base) else path


def write_outcome(folder: Path, outcome: RunOutcome) -> str:
    """Keep how a run ended in its folder; a sentence when it could not be written."""
    return _written(folder, OUTCOME, outcome.to_json())


def write_badge(
    path: Path, records: Sequence[Record], passed: bool | None, claims: Sequence[Claim]
) -> str:
    """Write the badge of a run; a sentence when it could not be written."""
    failed = _written(path.parent, path.name, badge(records, passed, claims))
    return f"no badge: {failed}" if failed else ""


def write_tables(folder: Path, to: Path | None) -> tuple[list[Table], list[str]]:
    """The tables of what a run folder holds on repeatability, and one sentence for each thing that
    is wrong; with a folder for it also as a file of Markdown."""
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


def columns_of(records: Sequence[Record]) -> dict[str, list[Any]]:
    """A value for each repetition, None where it has none, in each column.

    Columns: what identifies it, the task's parameters as JSON, its error, `metrics.<name>`,
    `cost.<name>` (see `records.metrics.COSTS`) and `seconds.<phase>`.
    """
    metrics = dict.fromkeys(name for record in records for name in record.metrics)
    errors = ("type", "phase", "message")
    return {
        **{name: [getattr(r, name) for r in records] for name in IDENTITY},
        "parameters": [task_parameters(record) for record in records],
        **{f"error.{name}": [getattr(r.error, name, None) for r in records] for name in errors},
        **{f"metrics.{name}": [r.metrics.get(name) for r in records] for name in metrics},
        **{f"cost.{cost.name}": [r.cost(cost.name) for r in records] for cost in COSTS},
        **{f"seconds.{name}": [r.seconds.get(name) for r in records] for name in PHASES},
    }


def csv_of(records: Sequence[Record]) -> str:
    """One line for each repetition; an empty cell where a record has no value; no text is a
    formula."""
    columns = columns_of(records)
    file = io.StringIO(newline="")
    rows = [[*columns], *zip(*columns.values(), strict=True)]
    csv.writer(file).writerows([for_csv(cell) for cell in row] for row in rows)
    return file.getvalue()
