"""What the tests of inner pytest runs share: a small test file, and what is looked at after."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from textwrap import dedent
from typing import Any

import pytest

FALLING = """
from tests.tiny import Falling

def test_falling(repeat):
    repeat(Falling())
"""

CLAIMING = FALLING.rstrip() + '.assert_at_least("landed", 0.1)\n'

NOTHING_LANDS = """
from tests.made_up import MadeUp

def pytest_sessionstart(session):
    ours = session.config.pluginmanager.get_plugin("simbench-session")
    found = {"status": "ok", "metrics": {"landed": 0.0}, "stepping": {"wall": 0.1}}
    ours.run.executor = MadeUp(1, lambda experiment, number: (found, None))
"""
"""A conftest: repetitions are made up."""


def records(folder: Path | str) -> list[dict[str, Any]]:
    """The records of a run folder."""
    return [json.loads(line) for line in Path(folder, "records.jsonl").read_text().splitlines()]


def no_traceback(result: pytest.RunResult) -> None:
    """Complain of a traceback, also of one inside pytest."""
    text = result.stdout.str() + result.stderr.str()
    assert "Traceback (" not in text
    assert "INTERNALERROR" not in text


def run_pytest(
    pytester: pytest.Pytester,
    words: str = "",
    *more: str,
    ret: int | None = None,
    **outcomes: int,
) -> pytest.RunResult:
    """An inner run, which has no traceback, and the exit code and outcomes that are given.

    Args:
        words: of the command line, separated by blanks.
        more: further words, which may hold blanks.
    """
    result = pytester.runpytest_subprocess(*words.split(), *more)
    no_traceback(result)
    if ret is not None:
        assert result.ret == ret, result.stdout.str() + result.stderr.str()
    if outcomes:
        result.assert_outcomes(**outcomes)
    return result


@contextmanager
def run_before(
    request: pytest.FixtureRequest, factory: pytest.TempPathFactory, test: str, words: str
) -> Iterator[Path]:
    """A folder in which pytest has run that test, for the tests of a whole module."""
    folder = factory.mktemp("before")
    (folder / "test_it.py").write_text(dedent(test))
    outer = {k: v for k, v in os.environ.items() if not k.startswith("PYTEST_XDIST")}
    command = [sys.executable, "-m", "pytest", *words.split()]
    environment = {**outer, "PYTHONPATH": str(request.config.rootpath)}
    subprocess.run(command, cwd=folder, env=environment, check=True, capture_output=True)
    yield folder
    shutil.rmtree(folder)


def usage_error(result: pytest.RunResult, *lines: str) -> None:
    """Complain if a run did not end with exit code 4, these lines and no traceback."""
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(lines)
    no_traceback(result)


def distribution(
    site: Path, name: str, entries: str | bytes, module: str = "", metadata: bool = True
) -> Path:
    """An installed package of another party, with entry points of simulators.

    Args:
        site: the folder that it lies in.
        name: of it, and with underscores of its module.
        entries: lines of the entry points.
        module: source of its module, if it has one.
        metadata: whether it has any besides the entry points.
    """
    folder = site / f"{name}-1.0.dist-info"
    folder.mkdir(parents=True)
    if metadata:
        (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    text = entries if isinstance(entries, bytes) else entries.encode()
    (folder / "entry_points.txt").write_bytes(b"[pytest_simbench.simulators]\n" + text + b"\n")
    if module:
        (site / f"{name.replace('-', '_')}.py").write_text(module)
    return site


def importable(monkeypatch: pytest.MonkeyPatch, site: Path) -> None:
    """Have inner runs find what is installed in a folder."""
    path = [str(site), *filter(None, [os.environ.get("PYTHONPATH")])]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(path))


def wrapper(python: Path) -> Path:
    """An interpreter of another name, which is this one."""
    python.parent.mkdir(parents=True, exist_ok=True)
    python.write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
    python.chmod(0o755)
    return python
