"""`tests/size.py` counts what git tracks, and fails above a ceiling alone."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from tests import size

ROOT = Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.skipif(not shutil.which("git"), reason="this machine has no git")


def test_lines_of_python_and_words_of_markdown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code = size.Part("code", ("a/*.py",), budget=1, ceiling=3)
    words = size.Part("words", ("*.md",), budget=9, ceiling=9)
    (tmp_path / "a" / "b").mkdir(parents=True)
    (tmp_path / "a" / "b" / "x.py").write_text("one = 1\n\n# two\n")
    (tmp_path / "a" / "page.md").write_text("three words here\n")
    subprocess.run(["git", "init", "-q"], cwd=tmp_path, check=True)
    subprocess.run(["git", "add", "a"], cwd=tmp_path, check=True)
    (tmp_path / "a" / "y.py").write_text("untracked = True\n")

    assert size.main((code, words), tmp_path) == 0
    assert size.main((replace(code, ceiling=2), words), tmp_path) == 1

    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert lines[1:3] == [["code", "3", "1", "3"], ["words", "3", "9", "9"]]
    assert lines[4] == ["code", "3", "1", "2", "above", "the", "ceiling"]


def test_ci_runs_it() -> None:
    assert "\n    .venv/bin/python tests/size.py\n" in (ROOT / ".ci" / "run").read_text("utf-8")
