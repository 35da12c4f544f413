"""Pictures of laws over time steps."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

from pytest_simbench.ground.names import file_name
from pytest_simbench.ground.text import for_figure
from pytest_simbench.measure.sweep import Point, Swept
from pytest_simbench.report.figures.drawing import Picture, canvas, line_style, plain_ticks
from pytest_simbench.report.model.sweep import labels, phenomena

WIDE = 4
"""Panels beside each other in a picture."""

NOTHING = "no error to draw"
"""Of a law that every simulator keeps exactly, or that none finished."""

OVER = {"step": "time step [ms]", "cost": "CPU s for a simulated s"}
"""What pictures show the error over, with the label of the axis."""


def pictures(found: Sequence[Swept]) -> Iterator[Picture]:
    """Two of each phenomenon, `sweep_PHENOMENON_step` and `..._cost`."""
    for phenomenon in phenomena(found):
        for over in OVER:
            name = file_name(f"sweep_{phenomenon.replace(' ', '_')}_{over}")
            drawn = partial(draw, found, phenomenon, over)
            yield Picture(name, drawn, caption(phenomenon, over))


def draw(found: Sequence[Swept], phenomenon: str, over: str) -> Any:
    """The error of each law of a phenomenon as a `matplotlib.figure.Figure`, within
    `figures.drawing`, over `step` or `cost`: a panel for each law, a line for each simulator."""
    laws = [law for law in found if law.phenomenon == phenomenon]
    names = labels(found)
    rows = math.ceil(len(laws) / WIDE)
    wide = min(len(laws), WIDE)
    figure = canvas(1 + 2.9 * wide, 0.9 + 2.4 * rows)
    panels = figure.subplots(rows, wide, squeeze=False).flatten()
    for axis, law in zip(panels, laws, strict=False):
        for place, (who, name) in enumerate(names.items()):
            for line in (line for line in law.lines if line.who == who):
                x, y = _course(line.points, over)
                axis.plot(x, y, ms=4, label=for_figure(name), **line_style(place))
        if over == "step" and law.tolerances:
            steps = sorted(law.tolerances)
            axis.plot([1e3 * h for h in steps], [law.tolerances[h] for h in steps], color="0.6",
                      lw=4, alpha=0.5, zorder=0, label="tolerance")  # fmt: skip
        if any(len(line.get_xdata()) for line in axis.lines):
            axis.set_xscale("log")
            axis.set_yscale("log", nonpositive="mask")
        else:  # which has no logarithm
            axis.text(0.5, 0.5, NOTHING, transform=axis.transAxes, ha="center", fontsize="small")
        plain_ticks(axis)
        axis.set_title(for_figure(law.law), fontsize="medium")
        axis.set_xlabel(OVER[over], fontsize="small")
        axis.set_ylabel(for_figure(f"error, {law.unit}" if law.unit else "error"), fontsize="small")
        axis.tick_params(labelsize="small")
        axis.grid(alpha=0.4)
    for axis in panels[len(laws) :]:
        axis.set_visible(False)
    known: dict[str, Any] = {}
    for axis in panels[: len(laws)]:
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            known.setdefault(label, handle)
    figure.legend(list(known.values()), list(known), loc="outside lower center",
                  ncols=min(8, len(known)), frameon=False, fontsize="small")  # fmt: skip
    return figure


def caption(phenomenon: str, over: str) -> str:
    """What a picture shows, in words."""
    what = "time step" if over == "step" else "CPU seconds for a simulated second"
    return f"{phenomenon}: error over {what}; a failure and an error of 0 are not drawn"


def _course(points: Sequence[Point], over: str) -> tuple[list[float], list[float]]:
    """What is drawn of a line."""
    shown = [(p.step * 1e3 if over == "step" else p.cost, p.error) for p in points]
    fine = [(x, y) for x, y in shown if x and math.isfinite(y) and y > 0]
    return [x for x, _ in fine], [y for _, y in fine]
