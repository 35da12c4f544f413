"""How pictures are drawn and saved, whatever they show.

matplotlib is an optional extra and is imported only when a picture is drawn.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pytest_simbench.ground.text import for_figure
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.paths import write_whole
from pytest_simbench.report.model.cells import unit

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


@dataclass(frozen=True)
class Picture:
    """A picture that is not drawn yet.

    Attributes:
        name: of its file, without ending.
        draw: makes it within `drawing`, a `matplotlib.figure.Figure`; None where there is nothing
            to draw.
        caption: what it shows, for the page; empty of one that the page has not.
    """

    name: str
    draw: Callable[[], Any]
    caption: str = ""


def write(folder: Path, pictures: Iterable[Picture]) -> list[Path]:
    """Draw pictures as PNG files in `folder`, each whole or not at all, and return their paths.

    Raises:
        FiguresUnavailable: matplotlib is not installed.
        OSError: the folder cannot be written to.
    """
    paths = []
    with drawing():
        for picture in pictures:
            if (figure := picture.draw()) is not None:
                drawn, name = io.BytesIO(), f"{picture.name}.png"
                figure.savefig(drawn, format="png", dpi=DPI)
                write_whole(folder, name, drawn.getvalue())
                paths.append(folder / name)
    return paths


@contextmanager
def drawing(**settings: Any) -> Iterator[None]:
    """While pictures are drawn and saved: no text means anything, no warning is shown. More
    settings of matplotlib may be given, `svg_fonttype` for `svg.fonttype`.

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


def canvas(width: float, height: float) -> Any:
    """An empty `matplotlib.figure.Figure` of that size [in]. It is none of pyplot's: no window, no
    display, no global state."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


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


def panelled(axis: Any, label: str, along: str = "x") -> None:
    """What panels have in common: a label and a grid along one of their axes."""
    getattr(axis, f"set_{along}label")(label)
    axis.grid(axis=along, alpha=0.4)


def plain_ticks(axis: Any) -> None:
    """Numbers beside the ticks of logarithmic scales: matplotlib's own are formulas."""
    for side in (axis.xaxis, axis.yaxis):
        side.set_major_formatter("{x:g}")
        side.set_minor_formatter("")
