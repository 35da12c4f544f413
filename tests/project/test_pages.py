"""Pages that repeat what stands in the code say the same."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

from pytest_simbench import __version__
from pytest_simbench.plugin.options import OPTIONS

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"


def test_the_page_names_every_option(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(DOCS)
    filled = runpy.run_path(str(DOCS / "made.py"))["filled"]
    page = filled((DOCS / "options.md").read_text("utf-8"))
    names = [name for item in OPTIONS for name in (item.flag, item.sure)]
    assert [name for name in names if f"`{name}" not in page] == []


def test_citation_names_this_version() -> None:
    text = (ROOT / "CITATION.cff").read_text("utf-8")
    assert re.findall(r"^version: (\S+)$", text, re.MULTILINE) == [__version__]


def test_changelog_begins_with_this_version() -> None:
    versions = re.findall(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.MULTILINE)
    assert versions[0] == __version__
