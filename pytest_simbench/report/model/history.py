"""A simulator's releases over time: sentences for terminal and Markdown, and a picture."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pytest_simbench.ground.names import file_name
from pytest_simbench.ground.text import for_figure
from pytest_simbench.measure.history import Course, History, histories
from pytest_simbench.measure.intervals import interval
from pytest_simbench.measure.law_history import LawHistory, law_histories
from pytest_simbench.records.folder import Reading
from pytest_simbench.report.figures.laws import draw_laws
from pytest_simbench.report.figures.task import COLOURS, drawing, heading, save

AnyHistory = History | LawHistory

SHOWN = 6
"""Panels of a picture at most: those that changed come first."""


def of_run(reading: Reading) -> list[AnyHistory]:
    """The histories in a run: of each test, and one of all laws."""
    return [*histories(reading.records, reading.metrics), *law_histories(reading.records)]


def lines(found: Sequence[AnyHistory], width: int) -> list[str]:
    """For the terminal."""
    result = []
    for history in found:
        span = f"{len(history.releases)} releases, {history.releases[0]} to {history.releases[-1]}"
        result.append(f"{history.title}: {span}")
        for text in history.sentences():
            result += textwrap.wrap(
                text, width, initial_indent="  ", subsequent_indent="    ", break_long_words=False
            )
    return result


def write_pictures(folder: Path, found: Sequence[AnyHistory]) -> list[Path]:
    """Draw each history as a PNG file, `SIMULATOR_TASK_history.png`, and return the paths.

    Raises:
        FiguresUnavailable: matplotlib is not installed.
        OSError: the folder cannot be written to.
    """
    paths = []
    with drawing():
        for history in found:
            name = file_name(f"{history.simulator}_{history.task}_history", *history.identity)
            figure = draw_laws(history) if isinstance(history, LawHistory) else draw(history)
            paths.append(save(figure, folder, name))
    return paths


def draw(history: History) -> Any:
    """Each metric over the releases as a `matplotlib.figure.Figure`, within `figures.drawing`.

    A dot is a mean, the line through it its 95 % interval, a dashed line a supported change point.
    """
    from matplotlib.figure import Figure

    # Those that changed, then what the study shows and the costs.
    shown = sorted(history.courses, key=lambda c: (not c.changes, not c.metric.study))[:SHOWN]
    figure: Any = Figure(
        figsize=(max(6.0, 2 + 0.45 * len(history.releases)), 0.9 + 1.5 * len(shown)),
        layout="constrained",
    )
    panels = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    for axis, course in zip(panels, shown, strict=True):
        _panel(axis, course)
    panels[-1].set_xticks(range(len(history.releases)), history.releases, rotation=45, ha="right")
    figure.suptitle(for_figure(history.title), fontsize="medium")
    return figure


def _panel(axis: Any, course: Course) -> None:
    metric = course.metric
    scale = 100 if metric.bounded else 1
    present = [place for place, values in enumerate(course.values) if values]
    for place in present:
        found = interval([*course.values[place].values()], metric)
        low, high = (min(max(x, -1e300), 1e300) for x in (found.low, found.high))
        if abs(low) < 1e299 and abs(high) < 1e299 and found.n > 1:
            axis.plot([place, place], [scale * low, scale * high], color=COLOURS[0], lw=2)
        axis.plot(place, scale * found.mean, "o", color=COLOURS[0], ms=4)
    for change in course.changes:
        axis.axvline(present[change.place] - 0.5, color=COLOURS[1], ls="--", lw=1)
    axis.set_ylabel(heading(metric, between="\n"), fontsize=8)
    axis.margins(y=0.15)
    low, high = axis.get_ylim()
    least = 4 * scale * metric.smallest_difference  # a deterministic engine's rounding is no course
    if high - low < least:
        axis.set_ylim((low + high - least) / 2, (low + high + least) / 2)
    axis.grid(axis="y", alpha=0.4)
