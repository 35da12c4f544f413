"""Pages that repeat what stands in the code say the same."""

from __future__ import annotations

import re
import runpy
from importlib import import_module
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


def test_modules_that_moved_are_where_the_page_says() -> None:
    page = (DOCS / "moved.md").read_text("utf-8")
    modules = []
    for old, now in re.findall(r"^\| (.*?) \| (.*) \|$", page, re.M):
        names = re.findall(r"`((?:pytest_simbench|laws|parity|testing)\.[a-z_.{}, ]+)`", now)
        if "the same in" in now:
            names[0] += "".join(re.findall(r"\.\{.*\}", old))
        for name in names:
            package, _, parts = name.removeprefix("pytest_simbench.").partition(".{")
            modules += [f"{package}.{part}".strip(".") for part in parts.rstrip("}").split(", ")]
    assert len(modules) > 15
    for module in modules:
        import_module(f"pytest_simbench.{module}")


def test_citation_names_this_version() -> None:
    text = (ROOT / "CITATION.cff").read_text("utf-8")
    assert re.findall(r"^version: (\S+)$", text, re.MULTILINE) == [__version__]


def test_changelog_begins_with_this_version() -> None:
    versions = re.findall(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.MULTILINE)
    assert versions[0] == __version__
