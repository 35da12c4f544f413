"""Results in the run folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_simbench.repeatability.store import NAME, Line, append, read

LINE = Line(
    "search",
    "t::x",
    "mujoco",
    "headless",
    "tuned",
    "towers",
    1,
    {"timestep": 0.1},
    {},
    {"n": 1 / 3},
)


def test_kept_and_read_back(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    assert read(folder) == []
    append(folder, LINE)
    append(folder, LINE)
    assert read(folder) == [LINE, LINE]
    assert LINE.label == "mujoco headless tuned"


@pytest.mark.parametrize("text", ["{}", "nonsense", "[1]", '{"schema": 1, "kind": "x"}'])
def test_something_else(tmp_path: Path, text: str) -> None:
    append(tmp_path, LINE)
    with (tmp_path / NAME).open("a") as file:
        file.write(text + "\n")
    with pytest.raises(ValueError, match="line 2: not a result on repeatability"):
        read(tmp_path)


def test_a_newer_schema(tmp_path: Path) -> None:
    append(tmp_path, LINE)
    path = tmp_path / NAME
    path.write_text(path.read_text().replace('"schema": 1', '"schema": 2'))
    with pytest.raises(ValueError, match="line 1: schema 2, this reads 1"):
        read(tmp_path)
