"""matplotlib's pictures as SVG that stands in the page: no scripts, no styles, nothing to load."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any
from xml.etree import ElementTree

from pytest_simbench.ground.names import digest
from pytest_simbench.measure.sweep import Swept
from pytest_simbench.measure.transfer import Transfer
from pytest_simbench.report.figures import sweep, transfer
from pytest_simbench.report.figures.drawing import FiguresUnavailable, drawing
from pytest_simbench.report.figures.task import draw
from pytest_simbench.report.model.summary import TaskSummary
from pytest_simbench.report.model.sweep import phenomena

SVG = "http://www.w3.org/2000/svg"
LINK = "http://www.w3.org/1999/xlink"

DROPPED = {f"{{{SVG}}}metadata", f"{{{SVG}}}style"}
"""Who drew it, and a style that would hold for the whole page."""

SHOWN = (
    ("times", "Start and end of the task: mean and deviation"),
    ("phases", "CPU and RAM along the phases of the task: means over all samples"),
)


@dataclass(frozen=True)
class Picture:
    """A picture: what it shows, and SVG that is safe in a page."""

    caption: str
    svg: str


def pictures(summary: TaskSummary) -> tuple[list[Picture], str]:
    """The pictures of a task; and a sentence where there are none and why."""
    return _drawn(
        (caption, (summary.task, name), partial(draw, summary, name, titled=False))
        for name, caption in SHOWN
    )


def of_sweeps(found: Sequence[Swept]) -> tuple[list[Picture], str]:
    """The pictures of laws over time steps; and a sentence where there are none and why."""
    return _drawn(
        (sweep.caption(of, over), ("sweep", of, over), partial(sweep.draw, found, of, over))
        for of in phenomena(found)
        for over in sweep.OVER
    )


def of_transfers(found: Sequence[Transfer]) -> tuple[list[Picture], str]:
    """The picture of each; and a sentence where there are none and why."""
    return _drawn(
        (transfer.CAPTION, ("transfer", str(place)), partial(transfer.draw, one))
        for place, one in enumerate(found)
    )


def _drawn(
    wanted: Iterable[tuple[str, tuple[str, ...], Callable[[], Any]]],
) -> tuple[list[Picture], str]:
    """Pictures by caption, name and what draws them; and a sentence where there are none and
    why."""
    found = []
    try:
        for caption, name, draw_it in wanted:
            # Names inside a picture are made of this, so that no two pictures share any.
            with drawing(svg_fonttype="none", svg_hashsalt=digest(*name)):
                figure = draw_it()
                if figure is not None:
                    drawn = io.BytesIO()
                    figure.savefig(drawn, format="svg", transparent=True)
                    found.append(Picture(caption, inline(drawn.getvalue())))
    except FiguresUnavailable as error:
        return [], str(error)
    return found, ""


def inline(drawn: bytes) -> str:
    """SVG as HTML takes it: without prolog, names, metadata and styles of its own."""
    root = ElementTree.fromstring(drawn)
    used = {
        value.rpartition("#")[2].rstrip(")")
        for element in root.iter()
        for name, value in element.attrib.items()
        if "#" in value and (name == f"{{{LINK}}}href" or value.startswith("url("))
    }
    for element in root.iter():
        for child in [c for c in element if c.tag in DROPPED]:
            element.remove(child)
        if element.get("id") not in used:
            element.attrib.pop("id", None)
        if (target := element.attrib.pop(f"{{{LINK}}}href", None)) is not None:
            element.set("href", target)
        element.tag = element.tag.removeprefix(f"{{{SVG}}}")
    # As wide as its place, and no wider than it was drawn.
    root.set("style", f"max-width: {root.attrib.pop('width')}")
    del root.attrib["height"]
    root.set("role", "img")
    return ElementTree.tostring(root, encoding="unicode", short_empty_elements=True)
