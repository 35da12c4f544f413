"""The report in the run folder: `report.md`, `report.csv` and, where matplotlib is, pictures."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

from pytest_simbench.records.folder import write_whole
from pytest_simbench.records.record import Record
from pytest_simbench.records.text import for_csv
from pytest_simbench.report import markdown
from pytest_simbench.report.figures import FiguresUnavailable, write_figures
from pytest_simbench.report.summary import PHASES, TaskSummary
from pytest_simbench.tasks.metrics import COSTS

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
    """

    problems: tuple[str, ...] = ()
    complete: bool = True


def write_report(
    folder: Path,
    summaries: Sequence[TaskSummary],
    records: Sequence[Record],
    figures: bool = True,
) -> Written:
    """Write all files; what cannot be written is told, and the rest is written all the same."""
    problems: list[str] = []
    failed: list[str] = []
    pictures: list[Path] = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        return Written((f"no report: {_unwritable(folder, error)}",), False)
    if figures:
        try:
            pictures = write_figures(folder, summaries)
        except FiguresUnavailable as error:
            problems.append(str(error))
        except OSError as error:
            failed.append(f"pictures: {_unwritable(folder, error)}")
    text = markdown.render_run(summaries, [picture.name for picture in pictures])
    for name, content in ((MARKDOWN_NAME, text), (CSV_NAME, csv_of(records))):
        try:
            write_whole(folder / name, content.encode("utf-8", "replace"))
        except OSError as error:
            failed.append(_unwritable(folder / name, error))
    return Written((*problems, *failed), not failed)


def _unwritable(path: Path, error: OSError) -> str:
    return f"{path} could not be written ({error.strerror or error})"


def csv_of(records: Sequence[Record]) -> str:
    """One line for each repetition; an empty cell where a record has no value.

    Columns: what identifies it, its error, `metrics.<name>`, `cost.<name>` (see
    `tasks.metrics.COSTS`) and `seconds.<phase>`.
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
