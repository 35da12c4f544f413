"""What the conftest at the top does for suites and tests."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest


def grouped(request: pytest.FixtureRequest, file: str, name: str) -> list[Any]:
    """The xdist groups of a test of that name in that file."""
    marks: list[pytest.Mark] = []
    item = SimpleNamespace(path=Path(file), name=name, add_marker=lambda m: marks.append(m.mark))
    top = request.config.pluginmanager.get_plugin(str(request.config.rootpath / "conftest.py"))
    assert top is not None
    top.pytest_collection_modifyitems([item])
    return [mark.args[0] for mark in marks]


def test_one_process_has_all_tests_of_an_engine_that_is_slow_to_start(
    request: pytest.FixtureRequest,
) -> None:
    assert grouped(request, "suites/test_stacking.py", "test_stacking[newton-headless]") == [
        "newton"
    ]
    assert grouped(request, "tests/sims/test_genesis.py", "test_fault_is_caught") == ["genesis"]
    assert grouped(request, "suites/test_stacking.py", "test_stacking[mujoco-headless]") == []
