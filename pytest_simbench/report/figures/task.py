"""Pictures of a run: metrics with intervals, start and end times, CPU and memory.

matplotlib is an optional extra and is imported only when a picture is drawn.
"""

from __future__ import annotations

import io
import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pytest_simbench.ground.names import file_name
from pytest_simbench.ground.text import for_figure
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.paths import write_whole
from pytest_simbench.report.model.answer import short_labels
from pytest_simbench.report.model.cells import unit
from pytest_simbench.report.model.pooling import merged_order
from pytest_simbench.report.model.summary import Row, TaskSummary

DPI = 120
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Okabe and Ito's palette: told apart by colour-blind readers too (jfly.uni-koeln.de/color)."""

MARKERS = "osD^vP*X"
"""With the colours, so that lines are told apart without them."""

PLAIN_TEXT: Any = {
    "text.usetex": False,
    "text.parse_math": False,
    "axes.formatter.use_mathtext": False,
}
"""No label is a formula or LaTeX, whatever `matplotlibrc` says."""


class FiguresUnavailable(RuntimeError):
    """Pictures cannot be drawn here; the message says what to install."""


def write_figures(folder: Path, summaries: Sequence[TaskSummary]) -> list[Path]:
    """Draw all pictures of a run as PNG files in `folder` and return their paths.

    Raises:
        FiguresUnavailable: matplotlib is not installed.
        OSError: the folder cannot be written to.
    """
    paths: list[Path] = []
    with drawing():
        for summary in summaries:
            for name in PICTURES:
                figure = draw(summary, name)
                if figure is not None:
                    paths.append(save(figure, folder, f"{file_name(summary.task)}_{name}"))
    return paths


def save(figure: Any, folder: Path, name: str) -> Path:
    """Write a picture as PNG, whole or not at all, and return its path; within `drawing`.

    Raises:
        OSError: the folder cannot be written to.
    """
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=DPI)
    write_whole(folder, f"{name}.png", picture.getvalue())
    return folder / f"{name}.png"


@contextmanager
def drawing(**settings: Any) -> Iterator[None]:
    """While pictures are drawn and saved: no text means anything, no warning is shown.

    Args:
        settings: more of matplotlib's, `svg_fonttype` for `svg.fonttype`.

    Raises:
        FiguresUnavailable: matplotlib is not installed.
    """
    try:
        from matplotlib import rc_context
    except ImportError as error:
        raise FiguresUnavailable(
            "no pictures: matplotlib is missing; pip install 'pytest-simbench[figures]'"
        ) from error
    more = {name.replace("_", "."): value for name, value in settings.items()}
    with rc_context(PLAIN_TEXT | more), warnings.catch_warnings():
        # Characters that the font lacks are drawn as boxes, long labels leave less room.
        warnings.simplefilter("ignore", UserWarning)
        yield


def draw(summary: TaskSummary, name: str, *, titled: bool = True) -> Any:
    """One picture of a task as a `matplotlib.figure.Figure`, within `drawing`.

    Args:
        summary: of the task.
        name: `metrics`, `times`, `resources` or `phases`.
        titled: whether a title stands above it.

    Returns:
        None where there is nothing to draw.
    """
    from matplotlib.figure import Figure

    rows = [row for row in summary.rows if row.finished]
    if rows and name == "metrics":  # who failed each time belongs beside the others
        rows = [row for row in summary.rows if row.finished or row.failed]
    if name == "phases":
        rows = [row for row in rows if row.by_phase]
    if not rows:
        return None
    # Figure without pyplot: no window, no display, no global state.
    if name == "phases":
        figure: Any = Figure(figsize=(9, 3.2 + 0.16 * len(rows)), layout="constrained")
        _phases(figure, rows)
        return figure
    panels, what, fill = PICTURES[name]
    panels = panels or max(1, len(summary.study))
    size = (max(7, 2 + 3.5 * panels), 1.6 + 0.4 * len(rows))
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots(1, panels, sharey=True, squeeze=False)[0]
    fill(axes, summary, rows)
    labels = [for_figure(label) for label in short_labels(rows)]
    if name == "metrics":
        labels = [label + _failed(row) for label, row in zip(labels, rows, strict=True)]
    axes[0].set_yticks(range(len(rows)), labels)
    axes[0].set_ylim(len(rows) - 0.5, -0.5)
    if titled:
        figure.suptitle(_title(summary, rows, what), fontsize="medium")
    return figure


def _failed(row: Row) -> str:
    """What a mean does not show: it is one of the repetitions that ended well."""
    return f"\n{row.failed} of {row.failed + row.finished} crashed" if row.failed else ""


def _title(summary: TaskSummary, rows: Sequence[Row], what: str) -> str:
    shared = [
        values.pop()
        for values in ({row.mode for row in rows}, {row.profile for row in rows})
        if len(values) == 1
    ]
    setting = for_figure(", ".join([*shared, summary.protocol]))
    return f"{for_figure(summary.task)} ({setting}): {what}"


def _metrics(axes: Sequence[Any], summary: TaskSummary, rows: Sequence[Row]) -> None:
    """A dot for each row and metric; the line is the interval, the grey one min to max."""
    for axis, metric in zip(axes, summary.study, strict=False):
        for y, row in enumerate(rows):
            found = row.metrics.get(metric.name)
            if found is None:
                continue
            scale = 100 if metric.bounded else 1
            if metric.kind != "yes_no":
                ends = [scale * found.min, scale * found.max]
                axis.plot(ends, [y, y], color="0.8", lw=6, solid_capstyle="butt", zorder=1)
            if found.low is not None and found.high is not None:
                axis.plot([scale * found.low, scale * found.high], [y, y], color=COLOURS[0], lw=2)
            axis.plot(scale * found.mean, y, "o", color=COLOURS[0])
        axis.set_xlabel(heading(metric))
        if metric.bounded:
            axis.set_xlim(-3, 103)
        axis.grid(axis="x", alpha=0.4)
        if metric.name in summary.references:
            axis.axvline(summary.references[metric.name], color="0.4", ls="--", lw=1)


def _times(axes: Sequence[Any], summary: TaskSummary, rows: Sequence[Row]) -> None:
    """A bar from the start of the task to its end, with the deviation of both."""
    (axis,) = axes
    for y, row in enumerate(rows):
        if row.start is None or row.end is None:
            continue
        axis.barh(
            y, row.end.mean - row.start.mean, left=row.start.mean, height=0.5, color=COLOURS[5]
        )
        for found, colour in ((row.start, COLOURS[2]), (row.end, COLOURS[1])):
            axis.errorbar(found.mean, y, xerr=found.std, fmt="o", color=colour, capsize=3, ms=4)
    axis.set_xlim(left=0)
    axis.set_xlabel("seconds from launch")
    axis.grid(axis="x", alpha=0.4)


def _resources(axes: Sequence[Any], summary: TaskSummary, rows: Sequence[Row]) -> None:
    """Bars of CPU and resident memory; a tick marks the peak of the memory."""
    for axis, name, label in (
        (axes[0], "cpu_percent", "CPU, % of a core"),
        (axes[1], "rss_mb", "RAM, MB (| is the peak)"),
    ):
        for y, row in enumerate(rows):
            found = getattr(row, name)
            if found is None or not math.isfinite(found.mean):
                continue
            axis.barh(y, found.mean, xerr=found.std, height=0.5, color=COLOURS[5], capsize=3)
            if found.peak is not None:
                axis.plot(found.peak, y, "|", color=COLOURS[1], ms=16, mew=2)
        axis.set_xlim(left=0)
        axis.set_xlabel(label)
        axis.grid(axis="x", alpha=0.4)


Fill = Callable[[Sequence[Any], TaskSummary, Sequence[Row]], None]

PICTURES: dict[str, tuple[int, str, Fill]] = {
    "metrics": (0, "mean with 95 % interval, min to max in grey", _metrics),
    "times": (1, "start and end of the task, with deviation", _times),
    "resources": (2, "CPU and RAM, mean and deviation over samples", _resources),
}
"""By name: panels (0: one for each metric of the study), what is shown, and what draws it."""


def _phases(figure: Any, rows: Sequence[Row]) -> None:
    """CPU and RAM along the task's phases, a line for each row."""
    order = merged_order(row.by_phase for row in rows)
    panels = figure.subplots(1, 2, squeeze=False)[0]
    for kind, (axis, label) in enumerate(zip(panels, ("CPU, % of a core", "RAM, MB"), strict=True)):
        for place, (row, name) in enumerate(zip(rows, short_labels(rows), strict=True)):
            known = [phase for phase in order if phase in row.by_phase]
            x = [order.index(phase) for phase in known]
            y = [row.by_phase[phase][kind].mean for phase in known]
            axis.plot(x, y, ms=5, label=for_figure(name), **line_style(place))
        axis.set_xticks(range(len(order)), map(for_figure, order), rotation=40, ha="right")
        axis.set_ylim(bottom=0)
        axis.set_ylabel(label)
        axis.grid(axis="y", alpha=0.4)
    handles, names = panels[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=4, frameon=False)


def line_style(place: int) -> dict[str, Any]:
    """Of the line of a row, by its place: other rows have other ones."""
    return {
        "marker": MARKERS[place % len(MARKERS)],
        "ls": ("-", "--")[place // len(COLOURS) % 2],
        "color": COLOURS[place % len(COLOURS)],
        "lw": 1.2,
    }


def heading(metric: Metric, between: str = ", ") -> str:
    """Title and unit for an axis."""
    return for_figure(between.join(filter(None, [metric.title, unit(metric)])))
