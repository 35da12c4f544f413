"""The report in the run folder: `report.md`, `report.csv` and, where matplotlib is, pictures."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, TextIO

from pytest_simbench.measure.metrics import COSTS
from pytest_simbench.measure.record import Record
from pytest_simbench.report import markdown
from pytest_simbench.report.figures import FiguresUnavailable, write_figures
from pytest_simbench.report.summary import PHASES, TaskSummary
from pytest_simbench.text import for_csv

MARKDOWN_NAME = "report.md"
CSV_NAME = "report.csv"

IDENTITY = (
    "test", "task", "simulator", "mode", "profile", "protocol", "repetition", "seed", "jitter",
    "status", "contended", "reused_worker",
)  # fmt: skip


def write_report(
    folder: Path,
    summaries: Sequence[TaskSummary],
    records: Sequence[Record],
    figures: bool = True,
) -> list[str]:
    """Write all files and return one line for each thing that could not be written.

    Raises:
        OSError: the folder cannot be written to.
    """
    problems: list[str] = []
    pictures: list[Path] = []
    if figures:
        try:
            pictures = write_figures(folder, summaries)
        except FiguresUnavailable as error:
            problems.append(str(error))
    text = markdown.render_run(summaries, [picture.name for picture in pictures])
    (folder / MARKDOWN_NAME).write_text(text, encoding="utf-8")
    write_csv(folder / CSV_NAME, records)
    return problems


def write_csv(path: Path, records: Sequence[Record]) -> None:
    """One line for each repetition; an empty cell where a record has no value.

    Columns: what identifies it, its error, `metrics.<name>`, `cost.<name>` (see
    `measure.metrics.COSTS`) and `seconds.<phase>`.
    """
    metrics = list(dict.fromkeys(name for record in records for name in record.metrics))
    with path.open("w", newline="", encoding="utf-8") as file:
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


class CellWriter:
    """Writes lines of a CSV file in which no text is a formula."""

    def __init__(self, file: TextIO) -> None:
        self._writer = csv.writer(file)

    def row(self, cells: Iterable[Any]) -> None:
        """One line; numbers stay numbers."""
        self._writer.writerow([for_csv(cell) for cell in cells])
