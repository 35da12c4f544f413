"""How a run ended is read back as it was; what somebody else wrote is checked."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from pytest_simbench.measure.gate import GateReport, run_gate
from pytest_simbench.measure.limits import Limit
from pytest_simbench.report.files import write_outcome
from pytest_simbench.report.model.outcome import NAME, RunOutcome, begun, cut_at, looks_at
from tests.report.samples import METRICS, record


def compared() -> GateReport:
    """A run that lost cubes against its baseline, in other settings."""
    worse = [record(repetition=k, metrics={"placed": 0.1}, settings={"x": 1}) for k in range(1, 7)]
    before = [record(repetition=k, metrics={"placed": 0.9 + k / 100}) for k in range(1, 7)]
    return run_gate(before, worse, (Limit("placed", 0.05, True),), METRICS)


@pytest.mark.parametrize(("passed", "loss"), [(True, 0.8), (False, math.inf), (None, 0.0)])
def test_it_is_read_back(passed: bool | None, loss: float, tmp_path: Path) -> None:
    report = compared()
    assert report.failures
    assert report.differences
    first, *others = report.changes
    report = replace(report, changes=(replace(first, loss=loss), *others))
    outcome = RunOutcome(passed, ("runs/before", report), looks=2)
    write_outcome(tmp_path, outcome)
    assert RunOutcome.read(tmp_path) == (outcome, "")


def test_a_folder_without_one_says_nothing(tmp_path: Path) -> None:
    assert RunOutcome.read(tmp_path) == (RunOutcome(), "")
    write_outcome(tmp_path, RunOutcome(True))
    assert RunOutcome.read(tmp_path) == (RunOutcome(True), "")
    assert RunOutcome(True).compared is None


def test_one_that_has_begun_keeps_what_was_open_and_how_often_it_was_looked_at(
    tmp_path: Path,
) -> None:
    assert begun(tmp_path, ["b", "a"]) == RunOutcome(looks=0, ended=False, open=("a", "b"))
    write_outcome(tmp_path, RunOutcome(True, ("b", compared()), 3, cut=("c",), open=("d",)))
    assert begun(tmp_path, ["a"]) == RunOutcome(
        None, looks=3, cut=("c",), ended=False, open=("a", "d")
    )


def spoilt(**changes: Any) -> str:
    """What is written of a comparison, with a part of its first change replaced."""
    with TemporaryDirectory() as folder:
        write_outcome(Path(folder), RunOutcome(True, ("b", compared())))
        data = json.loads((Path(folder) / NAME).read_text())
    data["comparison"]["changes"][0].update(changes)
    return json.dumps(data)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "does not say how the run ended"),
        ("[]", "does not say how the run ended"),
        ('{"schema": 2}', "written by a newer"),
        ('{"passed": "yes"}', "'passed': expected 'bool"),
        ('{"comparison": {}}', "it lacks 'changes'"),
        ('{"comparison": {"differences": [1], "broken": [], "notes": []}}', "does not say"),
        (spoilt(loss="x"), "does not say how the run ended"),
        (spoilt(metric={"name": "x", "title": "x", "kind": "odd"}), "does not say how"),
        (spoilt(limit={}), "there is no 'metric'"),
        (spoilt(test=3), "changes[0].test': expected 'str'"),
    ],
)
def test_what_is_none_is_told(text: str, told: str, tmp_path: Path) -> None:
    (tmp_path / NAME).write_text(text)
    found, problem = RunOutcome.read(tmp_path)
    assert found == RunOutcome()
    assert told in problem


def test_it_leads_nowhere_else(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    write_outcome(tmp_path, RunOutcome(True))
    (tmp_path / "run" / NAME).symlink_to(tmp_path / NAME)
    found, problem = RunOutcome.read(tmp_path / "run")
    assert found == RunOutcome()
    assert "leads out of its folder" in problem


def test_a_run_that_was_interrupted_before_anything_ended_was_not_looked_at(tmp_path: Path) -> None:
    write_outcome(tmp_path, RunOutcome(looks=2))
    interrupted, ended = record(repetition=1, status="interrupted"), record(repetition=2)
    assert looks_at(tmp_path, [interrupted], [ended]) == 2
    assert looks_at(tmp_path, [ended], [ended, record(repetition=3)]) == 3
    assert looks_at(tmp_path, [ended], [ended, interrupted]) == 2
    assert looks_at(tmp_path, [ended, interrupted], [ended, record(repetition=1)]) == 2
    another = record(repetition=1, simulator="mujoco==3.3.7", test="test_x[mujoco==3.3.7-headless]")
    assert looks_at(tmp_path, [ended], [ended, another]) == 2  # of a history that has grown
    whole = replace(interrupted, status="ok")
    assert cut_at(tmp_path, [ended, interrupted], [ended, whole], ()) == (ended.test,)
    assert looks_at(tmp_path, [ended, ended], [ended, record(repetition=3)]) == 3  # run again
