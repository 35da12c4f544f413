"""Pictures of how alike simulators rank policies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

from pytest_simbench.ground.names import file_name
from pytest_simbench.ground.text import for_figure
from pytest_simbench.measure.transfer import Transfer
from pytest_simbench.report.figures.drawing import Picture, canvas
from pytest_simbench.report.model.document import names
from pytest_simbench.report.model.transfer import interval

CAPTION = "tau-b between simulators; on the diagonal each against itself on other seeds"


def pictures(found: Sequence[Transfer]) -> Iterator[Picture]:
    """One of each, `transfer_TASK`; a task that is asked for otherwise has a number."""
    for place, one in enumerate(found):
        name = file_name(f"transfer_{one.task}{place or ''}")
        yield Picture(name, partial(draw, one), CAPTION)


def draw(found: Transfer) -> Any:
    """The matrix as a `matplotlib.figure.Figure`, within `figures.drawing`."""
    known = [for_figure(name) for name in names(found.simulators)]
    many = range(len(known))
    shown = [[found.tau(i, j) for j in many] for i in many]
    figure = canvas(1.6 + 1.1 * len(known), 1.2 + 0.7 * len(known))
    axis = figure.subplots()
    # Squares and no image: the page takes vectors alone. Blue is 1, red -1.
    values = [[tau.mean for tau in row] for row in shown]
    axis.pcolormesh(values, cmap="RdBu", vmin=-1, vmax=1)
    for i in many:
        for j in many:
            strong = abs(shown[i][j].mean) > 0.6
            axis.text(
                j + 0.5, i + 0.5, interval(shown[i][j]).replace(" [", "\n["), ha="center",
                va="center", fontsize="small", color="white" if strong else "black",
                weight="bold" if i == j else "normal",
            )  # fmt: skip
    axis.set_xticks([k + 0.5 for k in many], known, rotation=30, ha="right")
    axis.set_yticks([k + 0.5 for k in many], known)
    axis.invert_yaxis()
    return figure
