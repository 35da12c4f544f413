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
    assert [item.flag for item in OPTIONS for flag in item.flags if f"`{flag}" not in page] == []
