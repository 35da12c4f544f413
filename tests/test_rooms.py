"""The map of the house: which room may know which, and what no room may know."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from importlinter.cli import lint_imports

import pytest_simbench
from pytest_simbench.simulator.registry import adapter, registered

TOP = Path(pytest_simbench.__file__).parent

LIBRARIES = {"trimesh"}
"""What an engine needs beside itself and is none: Newton's meshes, the replay's viewer."""


def test_rooms_know_only_those_below_them_and_there_are_no_circles(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The contracts in pyproject.toml. Imports inside functions and for type checking count."""
    monkeypatch.chdir(TOP.parent)
    assert lint_imports(no_cache=True) == 0, capsys.readouterr().out


def imported(source: Path) -> Iterator[str]:
    """Every module that a source file imports, wherever in the file."""
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def test_the_core_imports_no_simulator() -> None:
    engines = {module for name in registered() for module in adapter(name).info.modules}
    roots = {"sims", "suites", *(module.partition(".")[0] for module in engines)} - LIBRARIES
    found = {
        (str(source.relative_to(TOP)), name)
        for source in TOP.rglob("*.py")
        for name in imported(source)
        if name.removeprefix("pytest_simbench.").partition(".")[0] in roots
    }
    assert not found


def test_the_core_names_no_simulator() -> None:
    """Not in a comment, an example or a message either. Newton also was a man, with laws."""
    names = "|".join(sorted({*registered(), "bullet", "physx", "webots"} - {"newton"}))
    found = {
        f"{source.relative_to(TOP)}:{number}: {line.strip()}"
        for source in TOP.rglob("*.py")
        for number, line in enumerate(source.read_text(encoding="utf-8").splitlines(), 1)
        if re.search(rf"(?i)\b({names})(?!['\w])", line)
        and "study" not in line  # who wrote down a constant: a source
    }
    assert not found


@pytest.mark.parametrize("room", ["scene", "description", "simulator", "parity", "worker"])
def test_workers_need_numpy_and_the_standard_library_alone(room: str) -> None:
    """A worker runs in interpreters that hold nothing else, the system's Python for instance."""
    allowed = {*sys.stdlib_module_names, "numpy", "pytest_simbench"}
    found = {
        (str(source.relative_to(TOP)), name)
        for source in (TOP / room).rglob("*.py")
        for name in imported(source)
        if name.partition(".")[0] not in allowed
    }
    assert not found


def test_there_is_no_loose_module() -> None:
    assert sorted(path.name for path in TOP.glob("*.py")) == ["__init__.py", "__main__.py"]
