"""Pictures in the page."""

from __future__ import annotations

from pytest_simbench.report.page.pictures import LINK, SVG, inline

DRAWN = f"""<?xml version="1.0"?>
<svg xmlns="{SVG}" xmlns:xlink="{LINK}" width="30pt" height="20pt" id="all" viewBox="0 0 3 2">
<g id="one"><metadata>who</metadata><style>* {{color: red}}</style><path id="dot" />
<path id="frame" d="#3" /></g>
<use xlink:href="#dot" x="1" /><path id="line" clip-path="url(#frame)" fill="#fff" /></svg>"""


def test_a_picture_keeps_what_it_refers_to_and_nothing_that_holds_for_the_page() -> None:
    assert inline(DRAWN.encode()).split("\n") == [
        '<svg viewBox="0 0 3 2" style="max-width: 30pt" role="img">',
        '<g><path id="dot" />',
        '<path id="frame" d="#3" /></g>',
        '<use x="1" href="#dot" /><path clip-path="url(#frame)" fill="#fff" /></svg>',
    ]
