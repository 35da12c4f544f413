"""The notebook and README's lines do what they say, without pytest's help."""

from __future__ import annotations

import ast
import json
import re
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]


def last_value(cell: str, names: dict[str, Any]) -> Any:
    """Execute a cell of a notebook; what its last line gives, as a notebook shows it."""
    *lines, last = ast.parse(cell).body
    exec(compile(ast.Module(lines, []), "<cell>", "exec"), names)
    if isinstance(last, ast.Expr):
        return eval(compile(ast.Expression(last.value), "<cell>", "eval"), names)
    return exec(compile(ast.Module([last], []), "<cell>", "exec"), names)


@pytest.mark.engine
def test_the_notebook_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    book = json.loads((ROOT / "docs" / "notebooks" / "compare.ipynb").read_text("utf-8"))
    names: dict[str, Any] = {}
    cells = ["".join(c["source"]) for c in book["cells"] if c["cell_type"] == "code"]
    _, table, differences, errors, compared = [last_value(cell, names) for cell in cells]
    assert "2 simulators did pushing" in str(table)
    assert "<table>" in table._repr_html_()
    assert "mujoco" in str(differences)
    assert len(errors) == 2
    assert "Compared with .simbench" in str(compared)
    assert (names["run"].folder / "report.html").is_file()
    assert [c["outputs"] for c in book["cells"] if c["cell_type"] == "code"] == [[]] * len(cells)


@pytest.mark.engine
def test_the_lines_of_readme_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    readme = (ROOT / "README.md").read_text("utf-8")
    (code,) = re.findall(r"```python\n(import pytest_simbench .*?)```", readme, re.DOTALL)
    assert len(code.splitlines()) <= 5
    exec(code.replace("reps=5", "protocol='smoke'"), {})
    assert (tmp_path / "report.html").is_file()
    assert "2 simulators did pushing" in capsys.readouterr().out
