"""A run is gone on with only as it was begun, also when nothing of it is missing."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pytest_simbench import __version__
from pytest_simbench.experiment.case import PROTOCOLS, Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.identity import expected
from pytest_simbench.experiment.resumed import NotResumed, Resumed, run_to_resume
from pytest_simbench.records.description import TaskDescription
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.record import Record, RecordError
from tests.made_up import MadeUp
from tests.tiny import Falling

Save = Callable[..., Resumed]


@pytest.fixture
def save(tmp_path: Path) -> Save:
    """A run folder with these records, to be resumed."""

    def saved(*records: Record) -> Resumed:
        (tmp_path / "records.jsonl").touch()
        folder = RunFolder(tmp_path)
        for record in records:
            folder.append(record)
        return Resumed(RunFolder(tmp_path))

    return saved


def ended(case: Case, task: Falling, *numbers: int, **changes: Any) -> list[Record]:
    """Records of repetitions that went well."""
    return [
        replace(
            expected(Experiment(case, task), k),
            status="ok",
            metrics={"landed": 1.0},
            **changes,
        )
        for k in numbers
    ]


def test_what_came_to_an_end_is_taken(case: Case, save: Save) -> None:
    task = Falling()
    cut = replace(ended(case, task, 3)[0], status="interrupted", metrics={})
    found = save(*ended(case, task, 1, 2), cut).take(Experiment(case, task), None)
    assert sorted(found) == [1, 2]
    assert save().take(Experiment(replace(case, test="another[mujoco-headless]"), task), None) == {}


@pytest.mark.parametrize(
    "now",
    [{"changes": {"timestep": "0.01"}}, {"changes": {"cone": "pyramidal"}}, {"profile": "default"},
     {"jitter": 50.0}, {"protocol": PROTOCOLS["paper"]}, {"seed": 770001}, {"timeout": 3.0},
     {"stall_timeout": 3.0}, {"memory_limit": 100.0}],
    ids=lambda value: next(iter(value)),
)  # fmt: skip
@pytest.mark.parametrize("status", ["ok", "interrupted", "failed"])
def test_a_complete_run_is_held_against_the_options_without_a_worker(
    case: Case, save: Save, now: dict[str, Any], status: str
) -> None:
    before = [replace(r, status=status) for r in ended(case, Falling(), 1, 2)]
    with pytest.raises(NotResumed, match=next(iter(now)).replace("changes", "settings")):
        save(*before).take(Experiment(replace(case, **now), Falling()), None)


def test_the_tasks_parameters_scene_and_code_are_compared(case: Case, save: Save) -> None:
    resumed = save(*ended(case, Falling(), 1))
    with pytest.raises(NotResumed, match=r"settings.task.duration was 0.6, is 9.0"):
        resumed.take(Experiment(case, Falling(duration=9.0)), None)
    (landed,) = Falling().metrics
    resumed.tasks["falling"] = TaskDescription("falling", (replace(landed, unit="mm"),))
    with pytest.raises(NotResumed, match="unit of the metric landed of falling was "):
        resumed.take(Experiment(case, Falling()), None)
    for name in ("scene", "task_code"):
        with pytest.raises(NotResumed, match=f"{name} was "):
            save(*ended(case, Falling(), 2, **{name: "of another task"})).take(
                Experiment(case, Falling()), None
            )


@pytest.mark.engine
@pytest.mark.parametrize("name", ["mujoco", "pytest-simbench", "python"])
def test_versions_that_are_known_here_are_compared(case: Case, save: Save, name: str) -> None:
    versions = expected(Experiment(case, Falling())).versions
    assert name in versions
    old = ended(case, Falling(), 1, versions={**versions, name: "0.0.1"})
    with pytest.raises(NotResumed, match=f'versions.{name} was "0.0.1", is "'):
        save(*old).take(Experiment(case, Falling()), None)


def test_versions_that_an_interrupted_start_never_told_are_not_compared(
    case: Case, save: Save
) -> None:
    versions = {**expected(Experiment(case, Falling())).versions, "python": ""}
    cut = replace(ended(case, Falling(), 2, versions=versions)[0], status="interrupted")
    found = save(*ended(case, Falling(), 1), cut).take(Experiment(case, Falling()), None)
    assert sorted(found) == [1]


def test_a_worker_is_asked_once_in_a_test_what_only_it_can_tell(case: Case, save: Save) -> None:
    asked: list[int] = []

    def tells(experiment: Experiment, number: int) -> tuple[dict[str, Any], None]:
        asked.append(number)
        return {"versions": {"engine": "2"}, "settings": {"more": 3}}, None

    worker, experiment = MadeUp(1, tells), Experiment(case, Falling())
    versions = {"engine": "1", "pytest-simbench": __version__}
    (known,) = ended(case, Falling(), 1, versions=versions)
    save(replace(known, simulator="other", test="other")).check_versions(experiment, worker)
    assert asked == []
    resumed = save(known)
    for test in (case.test, "another of the simulator"):
        with pytest.raises(NotResumed, match='versions.engine was "1", is "2"$'):
            resumed.check_versions(experiment.in_case(test=test), worker)
    resumed.check_versions(experiment, worker)  # it was told
    assert asked == [0, 0]


def test_the_run_that_began_last_is_gone_on_with(tmp_path: Path) -> None:
    for name, written in (("01_12-00-00-a", 2), ("01_12-00-00-b", 1), ("00_23-00-00-c", 3)):
        run = tmp_path / f"2026-07-{name}" / "records.jsonl"
        run.parent.mkdir()
        run.touch()
        os.utime(run, (written, written))
    assert run_to_resume(None, tmp_path).name == "2026-07-01_12-00-00-a"
    (killed := tmp_path / "2026-07-02_12-00-00-d").mkdir()  # in its first repetition
    RunFolder(killed).describe(Falling())
    assert run_to_resume(None, tmp_path) == killed
    assert Resumed(RunFolder(killed)).tasks == {}
    assert run_to_resume(run.parent, tmp_path) == run.parent
    for folder in (None, run):
        with pytest.raises(NotResumed, match="there is no run to resume in"):
            run_to_resume(folder, run)


def test_versions_of_somebody_elses_interpreter_are_not_guessed(case: Case) -> None:
    other = replace(case, python="/somewhere/bin/python")
    assert list(expected(Experiment(other, Falling())).versions) == ["pytest-simbench"]


def test_fewer_repetitions_than_recorded_are_refused_and_more_are_not(
    case: Case, save: Save
) -> None:
    resumed = save(*ended(case, Falling(), 1, 2, 3))
    with pytest.raises(NotResumed, match="reps was 3 or more, is 2"):
        resumed.take(Experiment(case, Falling()), 2)
    assert len(resumed.take(Experiment(case, Falling()), 4)) == 3
    assert len(resumed.take(Experiment(case, Falling()), None)) == 3


def test_a_mixture_of_an_older_plugin_is_refused(case: Case, save: Save) -> None:
    coarse = replace(case, changes={"timestep": 0.004})
    resumed = save(*ended(coarse, Falling(), 1, 2), *ended(case, Falling(), 3, 4))
    with pytest.raises(NotResumed, match="settings.timestep was 0.004, is 0.001"):
        resumed.take(Experiment(case, Falling()), None)


def test_two_tasks_of_one_test_are_taken_one_by_one(case: Case, save: Save) -> None:
    first, second = Falling(duration=0.2), Falling(duration=0.1)
    resumed = save(*ended(case, first, 1, 2), *ended(case, second, 1))
    assert [len(resumed.take(Experiment(case, task), None)) for task in (first, second)] == [2, 1]
    begun = Resumed(resumed.folder)
    begun.records = tuple(ended(case, first, 1, 2))  # it had not come to the second task
    assert [len(begun.take(Experiment(case, task), None)) for task in (first, second)] == [2, 0]


def test_each_attempt_gets_its_own(case: Case, save: Save) -> None:
    again = replace(case, attempt=2)
    resumed = save(*ended(case, Falling(), 1, 2), *ended(again, Falling(), 1))
    assert len(resumed.take(Experiment(case, Falling()), None)) == 2
    assert len(resumed.take(Experiment(again, Falling()), None)) == 1


def test_records_of_before_scene_and_limits_were_kept_go_on(case: Case, save: Save) -> None:
    old = ended(case, Falling(), 1, scene="", task_code="", limits={})
    assert len(save(*old).take(Experiment(case, Falling()), None)) == 1


@pytest.mark.engine
def test_expected_is_what_the_worker_reports(case: Case) -> None:
    from pytest_simbench.experiment.repetition import Repetition

    case = replace(case, changes={"timestep": "0.002"})
    record, error = Repetition(Experiment(case, Falling(duration=0.01)), 1).run()
    assert error is None
    now = expected(Experiment(case, Falling(duration=0.01))).to_dict()
    for name in ("settings", "scene", "limits", "profile", "protocol", "jitter", "versions"):
        assert record.to_dict()[name] == now[name]


@pytest.mark.engine
def test_a_start_that_fails_still_records_its_settings(case: Case) -> None:
    from pytest_simbench.experiment.repetition import Repetition

    record, error = Repetition(
        Experiment(replace(case, python="/nowhere/python"), Falling()), 1
    ).run()
    assert error is not None
    assert record.status == "failed"
    assert (
        record.to_dict()["settings"] == expected(Experiment(case, Falling())).to_dict()["settings"]
    )


@pytest.mark.engine
def test_a_time_out_failed_and_is_not_run_again(case: Case, save: Save) -> None:
    from pytest_simbench.experiment.repetition import Repetition

    case = replace(case, timeout=3.0)
    record, error = Repetition(Experiment(case, Falling(duration=1e5)), 1).run()
    assert error is not None
    assert (record.status, record.error.type) == ("failed", "RepetitionTimeout")
    assert list(save(record).take(Experiment(case, Falling(duration=1e5)), None)) == [1]


TEST = """
    from tests.tiny import Falling

    def test_falling(repeat, threshold):
        repeat(Falling(duration=0.2)).assert_at_most("landed", threshold("landed", 0.9))
"""


def test_on_the_command_line(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(TEST)

    def run(*arguments: str) -> pytest.RunResult:
        return pytester.runpytest_subprocess("--sim=mujoco", *arguments)

    run("--reps=3", "--sim-output=o").assert_outcomes(passed=1)
    path = pytester.path / "o" / "records.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    resume = ("--reps=3", "--sim-resume=o")
    for change in ("--sim-set=mujoco.timestep=0.01", "--jitter=50"):
        result = run(*resume, change)
        result.assert_outcomes(failed=1)
        result.stdout.fnmatch_lines(["*is not resumed, since its repetitions would not be*"])
        assert path.read_bytes() == b"".join(lines)
    run(*resume, "--sim-threshold=landed=0.5", "-n1").assert_outcomes(passed=1)
    # A power loss took the second record.
    path.write_bytes(lines[0] + b"\0" * len(lines[1]) + lines[2])
    result = run(*resume, "-n1")
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(
        [
            "falling: 3 repetitions, protocol fast",
            "*records.jsonl:2: the line is damaged and left out: it holds NUL bytes",
            "the damaged lines are kept in *records.jsonl.damaged-1",
        ]
    )
    again = path.read_bytes().splitlines(keepends=True)
    assert [again[0], again[1]] == [lines[0], lines[2]]
    assert [json.loads(line)["repetition"] for line in again] == [1, 3, 2]
    result = run("--reps=4", "--sim-resume=o")
    result.stdout.fnmatch_lines(["note: falling: judged 3 times, since repetitions were added *"])
    assert "judged 3 times" in (pytester.path / "o" / "report.md").read_text()


def test_a_run_is_failing_until_what_failed_runs_again(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(TEST + TEST.replace("falling(", "broken(") + "        assert 0\n")
    for more, passed in (
        (["--sim-output=o"], False),
        (["--sim-resume=o", "-k", "falling"], False),
        (["--sim-resume=o"], True),
    ):
        result = pytester.runpytest_subprocess("--sim=mujoco", "--reps=1", *more)
        assert json.loads((pytester.path / "o/outcome.json").read_text())["passed"] is passed
        result.stdout.fnmatch_lines(["test_broken: the test passes *FAIL*"] * (not passed))
        if "-k" in more:
            pytester.makepyfile(TEST + TEST.replace("falling(", "broken("))


def test_a_newer_schema_is_one_sentence(case: Case, save: Save) -> None:
    folder = save(*ended(case, Falling(), 1)).folder
    path = folder.path / "records.jsonl"
    path.write_text(path.read_text().replace('"schema": 2', '"schema": 9'))
    newer = ".*:1: schema 9 was written by a newer pytest-simbench"
    with pytest.raises(RecordError, match=newer):
        Resumed(RunFolder(folder.path))
