"""The contact sheet of a task: a row of pictures for each simulator, a column for each phase and
moment.

Each picture is by the engine's own renderer. matplotlib, an optional extra, puts them together.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from statistics import fmean

from pytest_simbench.experiment.identity import file_stem_of
from pytest_simbench.ground.names import file_name
from pytest_simbench.ground.text import for_figure
from pytest_simbench.recordings.film import PICTURES, Album
from pytest_simbench.records.paths import FolderError, inside
from pytest_simbench.records.record import Record
from pytest_simbench.report.figures.drawing import drawing

CELL = (2.0, 1.5)
"""Width and height of a picture on the sheet [inches]."""

MARGIN = (1.1, 0.35)
"""For the names, left and at the top [inches]."""

DPI = 110


def sheet_name(task: str) -> str:
    """The file's name."""
    return f"{file_name(task)}_pictures.png"


def albums(run: Path, records: Sequence[Record]) -> tuple[list[tuple[Record, Album]], list[str]]:
    """The albums of a run's repetitions, and what could not be read, one sentence each."""
    found, problems = [], []
    for record in records:
        try:
            path = inside(run, f"{PICTURES}/{file_stem_of(record)}.npz")
            if path.is_file():
                found.append((record, Album.read(path)))
        except (FolderError, ValueError) as error:
            problems.append(f"no pictures: {error}")
    return found, problems


def draw_sheet(rows: Sequence[tuple[Record, Album]]) -> bytes:
    """The sheet as PNG.

    Raises:
        FiguresUnavailable: matplotlib is not installed.
    """
    columns = _columns([album for _, album in rows])
    several = len({record.simulator for record, _ in rows}) < len(rows)
    width, height = (
        margin + cell * count
        for margin, cell, count in zip(MARGIN, CELL, (len(columns), len(rows)), strict=True)
    )
    with drawing():
        from matplotlib.figure import Figure

        figure = Figure(figsize=(width, height), facecolor="white")
        grid = figure.add_gridspec(
            len(rows), len(columns), left=MARGIN[0] / width, right=1, bottom=0,
            top=1 - MARGIN[1] / height, wspace=0.01, hspace=0.01,
        )  # fmt: skip
        for line, (record, album) in enumerate(rows):
            for column, shown in enumerate(columns):
                axes = figure.add_subplot(grid[line, column])
                axes.set_axis_off()
                if shown in album.pictures:
                    axes.imshow(album.pictures[shown])
                if line == 0:
                    axes.set_title(for_figure(shown), fontsize=9)
                if column == 0:
                    name = record.label if several else record.simulator
                    axes.text(
                        -0.03, 0.5, for_figure(name).replace(" ", "\n"), fontsize=9, ha="right",
                        va="center", transform=axes.transAxes,
                    )  # fmt: skip
        picture = io.BytesIO()
        figure.savefig(picture, format="png", dpi=DPI)
    return picture.getvalue()


def _columns(albums: Sequence[Album]) -> list[str]:
    """What the pictures show, in the order of time (the mean over the albums)."""
    times: dict[str, list[float]] = {}
    for album in albums:
        for shown, time in album.times.items():
            times.setdefault(shown, []).append(time)
    return sorted(times, key=lambda shown: fmean(times[shown]))


def sheets(run: Path, records: Sequence[Record]) -> tuple[dict[str, bytes], list[str]]:
    """The contact sheet of each task that has pictures, and what could not be read.

    Raises:
        FiguresUnavailable: matplotlib is not installed.
    """
    rows, problems = albums(run, records)
    tasks = dict.fromkeys(record.task for record, _ in rows)
    drawn = {task: draw_sheet([row for row in rows if row[0].task == task]) for task in tasks}
    return drawn, problems
