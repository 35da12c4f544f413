"""docs/options.md is what its script makes of the plugin."""

from __future__ import annotations

import runpy
from pathlib import Path

from pytest_simbench.plugin.options import OPTIONS

DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_the_page_is_up_to_date() -> None:
    script = runpy.run_path(str(DOCS / "make_options.py"))
    assert (DOCS / "options.md").read_text("utf-8") == script["page"](), (
        "run `python docs/make_options.py`"
    )


def test_the_page_names_every_option() -> None:
    page = (DOCS / "options.md").read_text("utf-8")
    names = [name for item in OPTIONS for name in (item.flag, item.sure)]
    assert [name for name in names if f"`{name}" not in page] == []
