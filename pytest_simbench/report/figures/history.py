"""Pictures of a simulator's releases: each metric over them, or each law."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

from pytest_simbench.ground.names import file_name
from pytest_simbench.ground.text import for_figure
from pytest_simbench.measure.history import (
    History,
    LawHistory,
    MetricCourse,
    Reached,
    TaskHistory,
    times,
)
from pytest_simbench.measure.intervals import interval
from pytest_simbench.measure.phenomena import BROKEN, KEPT
from pytest_simbench.report.figures.drawing import COLOURS, Picture, canvas, heading, panelled

SHOWN = 6
"""Panels of a picture at most: those that changed come first."""

STEPS = (
    (KEPT, "#d9e6f2", "kept"),
    (BROKEN, "#fee8b0", "missed by less than 2 tolerances"),
    (10.0, "#fdae61", "2 to 10"),
    (100.0, "#d7301f", "10 to 100"),
    (math.inf, "#7f0000", "more"),
)
"""Up to which ratio of error to tolerance, in which colour, and how the legend calls it."""

FAILS, NOT_ASKED = "#000000", "#ffffff"

ROW = 0.17
"""Height of a law [in]."""


def pictures(found: Sequence[History]) -> Iterator[Picture]:
    """Each history, `SIMULATOR_TASK_history`."""
    for history in found:
        name = file_name(
            f"{history.simulator}_{history.task}_history", history.test, history.variant
        )
        if isinstance(history, LawHistory):
            yield Picture(name, partial(draw_laws, history))
        elif isinstance(history, TaskHistory):
            yield Picture(name, partial(draw, history))


def draw(history: TaskHistory) -> Any:
    """Each metric over the releases as a `matplotlib.figure.Figure`, within `figures.drawing`.

    A dot is a mean, the line through it its 95 % interval, a dashed line a supported change point.
    """
    # Those that changed, then what the study shows and the costs.
    shown = sorted(history.courses, key=lambda c: (not c.changes, not c.metric.study))[:SHOWN]
    figure = canvas(max(6.0, 2 + 0.45 * len(history.releases)), 0.9 + 1.5 * len(shown))
    panels = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    for axis, course in zip(panels, shown, strict=True):
        _panel(axis, course)
    panels[-1].set_xticks(range(len(history.releases)), history.releases, rotation=45, ha="right")
    figure.suptitle(for_figure(history.title), fontsize="medium")
    return figure


def _panel(axis: Any, course: MetricCourse) -> None:
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
    panelled(axis, heading(metric, between="\n"), "y")
    axis.yaxis.label.set_fontsize(8)
    axis.margins(y=0.15)
    low, high = axis.get_ylim()
    least = 4 * scale * metric.smallest_difference  # a deterministic engine's rounding is no course
    if high - low < least:
        axis.set_ylim((low + high - least) / 2, (low + high + least) / 2)


def draw_laws(history: LawHistory) -> Any:
    """A `matplotlib.figure.Figure`, within `figures.drawing`.

    A bar at the left edge of a cell is a change, and its new ratio stands beside it; the names of
    laws that changed are bold.
    """
    from matplotlib.colors import to_rgb
    from matplotlib.patches import Patch

    laws, releases = history.laws, history.releases
    figure = canvas(max(6.0, 3 + 0.5 * len(releases)), 1.6 + ROW * len(laws))
    axis = figure.subplots()
    axis.imshow([[to_rgb(_colour(r)) for r in law.reached] for law in laws], aspect="auto")
    for x in range(1, len(releases)):
        axis.axvline(x - 0.5, color="white", lw=0.6)
    for y, law in enumerate(laws):
        for x, _, now in law.changes():
            axis.plot([x - 0.5, x - 0.5], [y - 0.5, y + 0.5], color="black", lw=2.5)
            dark = math.isinf(now.most) or now.most > STEPS[-3][0]
            axis.text(x, y, times(now), ha="center", va="center", fontsize=5.5,
                      color="white" if dark else "black")  # fmt: skip
    axis.set_xticks(range(len(releases)), releases, rotation=45, ha="right", fontsize=8)
    axis.set_yticks(range(len(laws)), [for_figure(law.name) for law in laws], fontsize=7)
    for label, law in zip(axis.get_yticklabels(), laws, strict=True):
        label.set_fontweight("bold" if any(law.changes()) else "normal")
    _phenomena(axis, history)
    named = [(colour, text) for _, colour, text in STEPS] + [(FAILS, "fails")]
    seen = {_colour(reached) for law in laws for reached in law.reached}
    figure.legend(
        handles=[Patch(facecolor=colour, label=text) for colour, text in named if colour in seen],
        loc="outside lower center", ncols=3, fontsize=7, frameon=False,
    )  # fmt: skip
    axis.tick_params(length=0)
    figure.suptitle(for_figure(history.title), fontsize="medium")
    return figure


def _phenomena(axis: Any, history: LawHistory) -> None:
    """A line between phenomena, and their names at the right."""
    names = [law.phenomenon for law in history.laws]
    starts = [y for y, name in enumerate(names) if y == 0 or name != names[y - 1]]
    for y, stop in zip(starts, [*starts[1:], len(names)], strict=True):
        if y:
            axis.axhline(y - 0.5, color="white", lw=2)
        axis.text(
            len(history.releases) - 0.4, (y + stop - 1) / 2, for_figure(names[y]), va="center",
            fontsize=7,
        )  # fmt: skip


def _colour(reached: Reached | None) -> str:
    if reached is None:
        return NOT_ASKED
    if math.isinf(reached.most):
        return FAILS
    return next(colour for most, colour, _ in STEPS if reached.most <= most)
