"""The picture of a search over settings: cost and error of candidates, and their front."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pytest_simbench.report.figures.drawing import canvas, plain_ticks

Point = tuple[float, float]
"""Cost and error."""


def draw(
    points: Sequence[Point], front: Sequence[Point], today: Point, cost: str, unit: str
) -> Any:
    """A `matplotlib.figure.Figure`, within `figures.drawing`."""
    from matplotlib.ticker import LogLocator

    figure = canvas(6.0, 4.0)
    axis = figure.subplots()
    axis.scatter(*zip(*points, strict=True), s=12, color="0.7", label="candidates")
    axis.step(*zip(*front, strict=True), where="post", marker="o", ms=4, label="front")
    axis.plot(*today, "D", color="#d55e00", label="today's settings")
    axis.set_xscale("log")
    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    errors = [error for _, error in (*points, today)]
    if min(errors) > 0:
        axis.set_yscale("log")
    elif max(errors) > 0:
        axis.set_yscale("symlog", linthresh=min(error for error in errors if error > 0))
        axis.set_ylim(bottom=0)
    plain_ticks(axis)
    axis.set_xlabel(cost)
    axis.set_ylabel(f"error [{unit}]" if unit else "error")
    axis.grid(alpha=0.4)
    axis.legend()
    return figure
