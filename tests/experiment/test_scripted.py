"""The record of a repetition whose world goes by a script: status, phase, scores, jitter."""

from __future__ import annotations

import json
import os
import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pytest_simbench.client.errors import RepetitionTimeout
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Hooks, Repetition
from pytest_simbench.records.record import Record
from pytest_simbench.scene import Pose
from pytest_simbench.tasks import Jitter, LeaningTowers, Stacking, Task, Throwing
from pytest_simbench.tasks.base import Outcome
from tests.approval import assert_approved, assert_approved_line
from tests.tasks.scripted import Effect, Mishap, ScriptedProcess, fail, move, put, stacked

TOWERS = LeaningTowers(margins=(0.01,))


class ScriptedRepetition(Repetition):
    """Its worker is a script."""

    def __init__(self, experiment: Experiment, number: int, *script: Mishap) -> None:
        super().__init__(experiment, number)
        self.process = ScriptedProcess(script)

    def _worker(self, deadline: float) -> Any:
        self.process.deadline = deadline
        self.process.where = self.where
        self._process: Any = self.process
        return self.process


def run(case: Case, task: Task, *script: Mishap) -> Record:
    repetition = ScriptedRepetition(Experiment(case, task), 1, *script)
    record, _ = repetition.run()
    assert not repetition.process.pending
    return record


def fast(process: ScriptedProcess) -> None:
    process.velocities["cube_02"] = np.array([0.0, 31.0, 0.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("effect", "message"),
    [
        (put("cube_02", Pose.at(5.2, 0.0, 0.025)), "'cube_02' left the room"),
        (put("cube_02", Pose.at(0.0, 0.0, 10.2)), "'cube_02' left the room"),
        (move("cube_02", z=-0.02), "overlap by 20 mm"),
        (put("cube_02", Pose.at(-1.0, 0.0, 0.0)), "'cube_02' is 25 mm deep in the ground"),
        (put("cube_02", Pose.at(-1.0, 0.0, -9.0)), "'cube_02' is 9025 mm deep in the ground"),
        (move("cube_02", x=float("nan")), "'cube_02' is not finite"),
        (fast, "'cube_02' moves at 31 m/s"),
    ],
)
@pytest.mark.parametrize("task", [TOWERS, Stacking(towers=1, levels=1)], ids=lambda t: t.name)
def test_a_world_that_cannot_be_has_diverged_and_no_score(
    case: Case, task: Task, effect: Effect, message: str
) -> None:
    record = run(case, task, Mishap("settle", 2.0, effect))
    assert record.status == "failed"
    assert (record.error.type, record.error.phase) == ("Diverged", "settle")
    assert message in record.error.message
    assert record.error.message.endswith(" s; a smaller timestep may help")
    assert not record.metrics


def test_it_may_happen_in_any_phase(case: Case) -> None:
    for phase in ("settle start", "pick cube 1 of 2", "place cube 2 of 2", "go home"):
        away = Mishap(phase, 0.1, put("cube_02", Pose.at(0.0, 6.0, 0.025)))
        record = run(case, Stacking(towers=1, levels=2), away)
        assert (record.error.type, record.error.phase) == ("Diverged", phase)


@pytest.mark.parametrize(
    "pose",
    [Pose.at(1.3, 0.2, 0.025), Pose.at(3.0, 0.0, 0.025), Pose.at(-3.0, -3.0, 0.025)],
)
def test_a_cube_beside_the_table_or_thrown_three_metres_is_counted(case: Case, pose: Pose) -> None:
    task = Stacking(towers=1, levels=2)
    record = run(case, task, Mishap("settle", 2.0, put(stacked(2), pose)))
    assert record.status == "ok"
    assert (record.metrics["placed"], record.metrics["at_end"]) == (1.0, 0.5)


def test_a_world_that_times_out_has_failed_where_it_was(case: Case) -> None:
    late = fail(RepetitionTimeout, "it took longer than 900 s")
    record = run(case, Stacking(towers=1, levels=2), Mishap("place cube 2 of 2", 0.3, late))
    assert record.status == "failed"
    assert (record.error.type, record.error.message, record.error.phase) == (
        "RepetitionTimeout", "it took longer than 900 s", "place cube 2 of 2"
    )  # fmt: skip
    assert record.error.cause == "RepetitionTimeout in place cube 2 of 2"
    assert not record.metrics
    interrupted = run(case, TOWERS, Mishap("settle", 0.3, fail(KeyboardInterrupt)))
    assert interrupted.status == "interrupted"


@pytest.mark.parametrize(("timeout", "seconds"), [(None, 60.0), (7.0, 7.0)])
def test_a_repetition_has_the_studys_time_out_or_the_users(
    case: Case, timeout: float | None, seconds: float
) -> None:
    repetition = ScriptedRepetition(Experiment(replace(case, timeout=timeout), TOWERS), 1)
    began = time.monotonic()
    record, _ = repetition.run()
    deadline = repetition.process.deadline
    assert deadline is not None
    assert began + seconds <= deadline <= time.monotonic() + seconds
    assert record.limits["timeout"] == seconds


def test_all_that_is_in_the_record(case: Case) -> None:
    """Whatever the case says of it, scores, details, and what a task tells meanwhile."""
    case = replace(
        case, function="test_x", variant="mine", seed=7, jitter=0.5, memory_limit=900.0, attempt=2,
        contended=True, own_timestep=0.002, needs=("--policies=x.py",), trace="on",
    )  # fmt: skip
    task, told = replace(TOWERS, margins=(0.01, 0.01)), list[str]()
    fallen = Mishap("settle", 2.0, move("cube_08", x=0.1))
    repetition = ScriptedRepetition(Experiment(case, task), 3, fallen)
    repetition.hooks = Hooks(
        begin=lambda node: told.append("begins"), phase=told.append,
        count=lambda *counts: told.append(f"{counts}"),
    )  # fmt: skip
    record, error = repetition.run()
    assert error is None
    found = record.to_dict()
    for passing in ("host", "versions", "timeline"):
        assert found.pop(passing)
    found["seconds"] = {kind: seconds > 0 for kind, seconds in found["seconds"].items()}
    files = sorted(path.name for path in case.folder.glob("*/*"))
    assert_approved("record", "\n".join([*told, *files, json.dumps(found, indent=1)]))


def test_the_peak_of_memory_is_the_worker_s_own(case: Case) -> None:
    repetition = ScriptedRepetition(Experiment(case, TOWERS), 1)
    repetition.process.pid = os.getpid()
    repetition.process.do_stats = lambda: {"peak_rss_mb": 1e6}  # type: ignore[method-assign]
    assert repetition.run()[0].resources["rss_mb"]["peak"] == 1e6


WRONG = [True, {"other": 1.0}, {"towers": 1.0, "standing": 2.0}, {"towers": 1.0, "standing": "x"}]


@pytest.mark.parametrize("score", WRONG)
def test_an_outcome_that_cannot_be_is_a_failure(
    case: Case, monkeypatch: pytest.MonkeyPatch, score: Any
) -> None:
    monkeypatch.setattr(LeaningTowers, "perform", lambda *_: score is True or Outcome(score))
    record = run(case, TOWERS)
    assert (record.status, record.metrics) == ("failed", {})
    assert_approved_line("outcomes", f"{score}: {record.error}")


@pytest.mark.parametrize("task", [Stacking(), Throwing()], ids=lambda t: t.name)
@pytest.mark.parametrize("scale", [0.0, 1.0, 3.0])
def test_the_start_is_disturbed_as_asked_for(case: Case, task: Task, scale: float) -> None:
    repetition = ScriptedRepetition(
        Experiment(replace(case, jitter=scale, seed=40), task),
        3,
        Mishap("settle start", 0.0, fail(StopHere)),
    )
    record, _ = repetition.run()
    assert (record.seed, record.jitter) == (42, scale)
    one = Jitter()
    expected = task.scene(42, Jitter(scale * one.distance, scale * one.angle))
    there = repetition.process.scene
    assert replace(there, robot=expected.robot) == expected
    assert there.robot is not None
    assert expected.robot is not None
    files = {key: getattr(expected.robot, key) for key in ("urdf", "srdf", "packages")}
    assert replace(there.robot, **files) == expected.robot  # it travels without its paths
    nominal = task.scene(42, Jitter(0.0, 0.0))
    for body, still in zip(expected.free_bodies, nominal.free_bodies, strict=True):
        assert (body.pose == still.pose) == (scale == 0.0)


class StopHere(Exception):
    """The test has seen what it wants."""
