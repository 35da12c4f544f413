"""Results in the run folder."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from pytest_simbench.records.lines import Found
from pytest_simbench.records.repeatability import NAME, Again, Line, StateDifference, append, read

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
    {"n": 1 / 3, "sentence": "0.1 mm in x topples it"},
)


AGAIN = Again(
    way="reset", first=1.0, body="a", growth={"1": 0.1, "5": None}, largest=0.2, changed=["moved"]
).to_wire()
REPLAY = replace(LINE, kind="replay", result={"claims": True, "again": [AGAIN]})


@pytest.mark.parametrize("part", ["first", "body", "growth", "largest"])
def test_two_runs_part_whole_or_not_at_all(part: str) -> None:
    whole = {"first": 1.0, "body": "a", "growth": {}, "largest": 0.2}
    assert StateDifference(**whole) != StateDifference()  # type: ignore[arg-type]
    for told in (whole | {part: None}, {part: whole[part]}):
        with pytest.raises(ValueError, match="it parted in part"):
            StateDifference(**told)  # type: ignore[arg-type]


def test_kept_and_read_back(tmp_path: Path) -> None:
    folder = tmp_path / "a" / "run"
    assert read(folder).items == ()
    for line in (LINE, REPLAY):
        append(folder, line)
    assert read(folder).items == (REPLAY, LINE)
    assert LINE.label == "mujoco headless tuned"


def test_what_is_asked_again_replaces_what_was_said(tmp_path: Path) -> None:
    """As in a run that is completed; other tasks, seeds, bounds are asked besides."""
    now = replace(LINE, settings={"timestep": 0.2}, versions={"mujoco": "2"})
    others = [
        replace(LINE, test="t::y"),
        replace(LINE, kind="stability"),
        replace(LINE, task="towering"),
        replace(LINE, seed=2),
        replace(LINE, settings={"task.layers": 2}),
        replace(LINE, result={**LINE.result, "bounds": "1 mm"}),
        replace(LINE, result={**LINE.result, "perturbation": "x"}),
    ]
    for line in (LINE, *others, now):
        append(tmp_path, line)
    found = read(tmp_path).items
    assert len(found) == 8
    assert all(line in found for line in (*others, now))


@pytest.mark.parametrize(
    "line",
    [
        replace(LINE, kind="x"),
        replace(LINE, seed="1"),
        replace(LINE, task=None),
        replace(LINE, result={}),
        replace(LINE, result={"sentence": 3}),
        replace(REPLAY, result={"claims": True}),
        replace(REPLAY, result={"claims": True, "again": 3}),
        *(
            replace(REPLAY, result={"claims": True, "again": [{**AGAIN, key: wrong}]})
            for key in ("way", "changed", "first", "growth", "largest", "body", "left_at")
            for wrong in ("x" if key not in ("way", "body") else 1, {"x": "y"}, [3])
            if not (key == "changed" and wrong == "x")
        ),
    ],
    ids=lambda line: str(line.result)[:80],
)
def test_a_line_with_something_else_in_it(tmp_path: Path, line: Line) -> None:
    append(tmp_path, line)
    assert read(tmp_path) == Found(refused=(f"{tmp_path / NAME}:1: not a result on repeatability",))


def test_no_number_is_infinite(tmp_path: Path) -> None:
    append(
        tmp_path, replace(REPLAY, result={"claims": True, "again": [{**AGAIN, "first": math.inf}]})
    )
    assert read(tmp_path).items == ()
    (problem,) = read(tmp_path).problems
    assert "Infinity is no number in JSON" in problem


@pytest.mark.parametrize(
    "text", ["{}", "nonsense", "[1]", '{"schema": 1, "kind": "x"}', "[" * 99999, '{"schema": 1, "t']
)
def test_something_else_loses_no_other_line(tmp_path: Path, text: str) -> None:
    append(tmp_path, LINE)
    with (tmp_path / NAME).open("a") as file:
        file.write(text)  # torn: no end of the line
    append(tmp_path, REPLAY)
    found = read(tmp_path)
    assert found.items == (REPLAY, LINE)
    (problem,) = (*found.problems, *found.refused)
    assert problem.startswith(f"{tmp_path / NAME}:2: ")
    assert len(problem) < 400


def test_a_full_disk_keeps_the_result_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "spare"))
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / NAME).symlink_to("/dev/full")
    told = append(tmp_path / "run", LINE)
    assert read(told.fallback.parent).items == (LINE,)


def test_a_newer_schema(tmp_path: Path) -> None:
    append(tmp_path, LINE)
    path = tmp_path / NAME
    path.write_text(path.read_text().replace('"schema": 1', '"schema": 2'))
    assert read(tmp_path) == Found(refused=(f"{path}:1: schema 2, this reads 1",))
