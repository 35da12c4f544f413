"""The settings of `mutmut run` go by files that are there."""

from __future__ import annotations

import tomllib
from fnmatch import fnmatch
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["mutmut"]
SOURCES = [str(path.relative_to(ROOT)) for path in (ROOT / "pytest_simbench").rglob("*.py")]


def mutated() -> set[str]:
    chosen = {p for p in SOURCES if any(fnmatch(p, q) for q in SETTINGS["only_mutate"])}
    return chosen - set(SETTINGS["do_not_mutate"])


@pytest.mark.parametrize("room", ["tasks", "measure", "worker", "repeatability", "records"])
def test_a_room_is_mutated_but_for_what_needs_engines(room: str) -> None:
    whole = {path for path in SOURCES if path.startswith(f"pytest_simbench/{room}/")}
    assert whole - mutated() == set(SETTINGS["do_not_mutate"]) & whole


def test_every_pattern_and_every_test_leads_to_files() -> None:
    patterns = [*SETTINGS["only_mutate"], *SETTINGS["do_not_mutate"]]
    assert [p for p in patterns if not any(fnmatch(path, p) for path in SOURCES)] == []
    tests = [
        *SETTINGS["pytest_add_cli_args_test_selection"],
        *(a.partition("=")[2] for a in SETTINGS["pytest_add_cli_args"] if a.startswith("--ig")),
        *SETTINGS["also_copy"],
    ]
    assert [name for name in tests if not (ROOT / name).exists()] == []
