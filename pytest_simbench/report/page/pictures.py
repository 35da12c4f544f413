"""matplotlib's pictures as SVG that stands in the page: no scripts, no styles, nothing to load."""

from __future__ import annotations

import io
from collections.abc import Iterable
from dataclasses import dataclass
from xml.etree import ElementTree

from pytest_simbench.ground.names import digest
from pytest_simbench.report.figures.drawing import FiguresUnavailable, Picture, drawing
from pytest_simbench.worker.wire import named

SVG = "http://www.w3.org/2000/svg"
LINK = "http://www.w3.org/1999/xlink"

DROPPED = {f"{{{SVG}}}metadata", f"{{{SVG}}}style"}
"""Who drew it, and a style that would hold for the whole page."""


@dataclass(frozen=True)
class Drawn:
    """A picture: what it shows, and SVG that is safe in a page."""

    caption: str
    svg: str


def drawn(pictures: Iterable[Picture]) -> tuple[list[Drawn], str]:
    """The pictures; and a sentence where there are none and why."""
    found = []
    try:
        for picture in pictures:
            # Names inside a picture are made of this, so that no two pictures share any.
            with drawing(svg_fonttype="none", svg_hashsalt=digest(picture.name)):
                figure = picture.draw()
                if figure is not None:
                    file = io.BytesIO()
                    figure.savefig(file, format="svg", transparent=True)
                    found.append(Drawn(picture.caption, inline(file.getvalue())))
    except FiguresUnavailable as error:
        return [], str(error)
    except Exception as error:  # a fault of ours, which costs the pictures and no table
        return [], f"the pictures could not be drawn: {named(error)}"
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
