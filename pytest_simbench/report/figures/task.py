"""Pictures of a task: metrics with intervals, start and end times, CPU and memory."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

from pytest_simbench.ground.names import file_name
from pytest_simbench.ground.text import for_figure
from pytest_simbench.report.figures.drawing import (
    COLOURS,
    Picture,
    canvas,
    heading,
    line_style,
    panelled,
)
from pytest_simbench.report.model.pooling import merged_order
from pytest_simbench.report.model.summary import Row, TaskSummary, short_labels

ON_PAGE = {
    "times": "Start and end of the task: mean and deviation",
    "phases": "CPU and RAM along the phases of the task: means over all samples",
}
"""Pictures that the page has of a task, and their captions."""


def pictures(summaries: Sequence[TaskSummary]) -> Iterator[Picture]:
    """Those that a run folder holds, `TASK_NAME`."""
    for summary in summaries:
        for name in PICTURES:
            yield Picture(f"{file_name(summary.task)}_{name}", partial(draw, summary, name))


def on_page(summary: TaskSummary) -> Iterator[Picture]:
    """Those of a task on the page, which have captions in place of titles."""
    for name, caption in ON_PAGE.items():
        drawn = partial(draw, summary, name, titled=False)
        yield Picture(f"{file_name(summary.task)}_{name}", drawn, caption)


def draw(summary: TaskSummary, name: str, *, titled: bool = True) -> Any:
    """One picture of a task (`metrics`, `times`, `resources` or `phases`) as a
    `matplotlib.figure.Figure`, within `drawing`; None where there is nothing to draw."""
    rows = [row for row in summary.rows if row.finished]
    if rows and name == "metrics":  # who failed each time belongs beside the others
        rows = [row for row in summary.rows if row.finished or row.failed]
    if name == "phases":
        rows = [row for row in rows if row.by_phase]
    if not rows:
        return None
    if name == "phases":
        figure = canvas(9, 3.2 + 0.16 * len(rows))
        _phases(figure, rows)
        return figure
    panels, what, fill = PICTURES[name]
    panels = panels or max(1, len(summary.study))
    figure = canvas(max(7, 2 + 3.5 * panels), 1.6 + 0.4 * len(rows))
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
    """What a mean does not show."""
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
        panelled(axis, heading(metric))
        if metric.bounded:
            axis.set_xlim(-3, 103)
        if metric.name in summary.references:
            axis.axvline(summary.references[metric.name], color="0.4", ls="--", lw=1)


def _times(axes: Sequence[Any], summary: TaskSummary, rows: Sequence[Row]) -> None:
    """A bar from the start of the task to its end, with the deviation of both."""
    (axis,) = axes
    for y, row in enumerate(rows):
        start, end = row.costs.get("start"), row.costs.get("end")
        if start is None or end is None:
            continue
        axis.barh(y, end.mean - start.mean, left=start.mean, height=0.5, color=COLOURS[5])
        for found, colour in ((start, COLOURS[2]), (end, COLOURS[1])):
            axis.errorbar(found.mean, y, xerr=found.std, fmt="o", color=colour, capsize=3, ms=4)
    axis.set_xlim(left=0)
    panelled(axis, "seconds from launch")


def _resources(axes: Sequence[Any], summary: TaskSummary, rows: Sequence[Row]) -> None:
    """Bars of CPU and resident memory; a tick marks the peak of the memory."""
    for axis, name, label in (
        (axes[0], "cpu", "CPU, % of a core"),
        (axes[1], "ram", "RAM, MB (| is the peak)"),
    ):
        for y, row in enumerate(rows):
            found = row.costs.get(name)
            if found is None or not math.isfinite(found.mean):
                continue
            axis.barh(y, found.mean, xerr=found.std, height=0.5, color=COLOURS[5], capsize=3)
            if found.peak is not None:
                axis.plot(found.peak, y, "|", color=COLOURS[1], ms=16, mew=2)
        axis.set_xlim(left=0)
        panelled(axis, label)


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
    panels = figure.subplots(1, 2)
    for kind, (axis, label) in enumerate(zip(panels, ("CPU, % of a core", "RAM, MB"), strict=True)):
        for place, (row, name) in enumerate(zip(rows, short_labels(rows), strict=True)):
            known = [phase for phase in order if phase in row.by_phase]
            x = [order.index(phase) for phase in known]
            y = [row.by_phase[phase][kind].mean for phase in known]
            axis.plot(x, y, ms=5, label=for_figure(name), **line_style(place))
        axis.set_xticks(range(len(order)), map(for_figure, order), rotation=40, ha="right")
        axis.set_ylim(bottom=0)
        panelled(axis, label, "y")
    handles, names = panels[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=4, frameon=False)
