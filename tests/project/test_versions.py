"""The version stands in one place; what repeats it says the same."""

from __future__ import annotations

import re
from pathlib import Path

from pytest_simbench import __version__

ROOT = Path(__file__).resolve().parents[2]


def test_citation_names_this_version() -> None:
    text = (ROOT / "CITATION.cff").read_text("utf-8")
    assert re.findall(r"^version: (\S+)$", text, re.MULTILINE) == [__version__]


def test_changelog_begins_with_this_version() -> None:
    versions = re.findall(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.MULTILINE)
    assert versions[0] == __version__
