"""Every way in which a worker can fail, on real processes: typed error, record, next repetition."""

from __future__ import annotations

import os
import re
import stat
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.executor import LocalExecutor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repeater import Repeater
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.records.record import Record
from tests.conftest import ADAPTERS, workers
from tests.tiny import Falling


class Silent:
    """Progress that nobody watches."""

    def __getattr__(self, name: str) -> object:
        return lambda *arguments: None


def run(case: Case, adapter: str | None = None, number: int = 1) -> Record:
    if adapter is not None:
        case = faulty(case, adapter)
    before = workers()
    record, _ = Repetition(Experiment(case, Falling()), number).run()
    assert Record.from_json(record.to_json()) == Record.from_json(record.to_json())
    assert not workers() - before, "a worker was left behind"
    return record


def faulty(case: Case, fault: str) -> Case:
    """The case on the same engine with a fault."""
    engine = case.adapter.rpartition(":")[2]
    return replace(case, adapter=f"tests.client.faulty:{engine}_{fault}")


@pytest.fixture(params=["mujoco", "pybullet"])
def engine(case: Case, request: pytest.FixtureRequest) -> Case:
    """The case on each engine."""
    return replace(case, simulator=request.param, adapter=ADAPTERS[request.param])


@pytest.mark.parametrize(
    ("adapter", "error", "message"),
    [
        ("Killed", "WorkerExited", "was killed by SIGKILL"),
        ("Crashed", "WorkerExited", "was killed by SIGSEGV"),
        ("Stopped", "WorkerHung", "no sign of life"),
        ("Hung", "WorkerHung", "no sign of life"),
        ("Raising", "EngineFailed", "ValueError: the engine is unhappy"),
        ("NotANumber", "Diverged", "not finite at t = 0.3"),
    ],
)
def test_fault_while_stepping(engine: Case, adapter: str, error: str, message: str) -> None:
    case = replace(engine, stall_timeout=3.0)
    record = run(case, adapter)
    assert record.status == "failed"
    assert record.error is not None
    assert (record.error.type, record.error.phase) == (error, "fall")
    assert message in record.error.message
    assert run(case, number=2).metrics == {"landed": 1.0}


def test_the_log_tail_shows_where_it_crashed(engine: Case) -> None:
    record = run(engine, "Crashed")
    assert record.error is not None
    assert "Segmentation fault" in record.error.log_tail
    assert "in fault" in record.error.log_tail


def test_a_worker_that_eats_memory_is_killed(engine: Case) -> None:
    record = run(replace(engine, memory_limit=500.0), "Greedy")
    assert record.error is not None
    assert record.error.type == "OutOfMemory"
    assert "limit of 500 MB" in record.error.message
    assert record.resources["rss_mb"]["peak"] > 500


def test_a_repetition_times_out(engine: Case) -> None:
    record = run(replace(engine, timeout=2.0), "Hung")
    assert record.error is not None
    assert (record.status, record.error.type) == ("failed", "RepetitionTimeout")
    assert "--sim-timeout" in record.error.message
    # Its own time-out ended it, neither the task's (60 s) nor the limit of silence (20 s).
    assert 2.0 <= record.seconds["total"] < engine.stall_timeout


def test_garbage_on_stdout_harms_nothing(engine: Case) -> None:
    record = run(engine, "Chatty")
    assert (record.status, record.metrics) == ("ok", {"landed": 1.0})


def test_crash_while_closing_does_not_fail_a_finished_repetition(engine: Case) -> None:
    record = run(engine, "CrashesClosing")
    assert record.status == "ok"
    assert "SIGSEGV" in record.notes.closing


def test_exit_at_import(case: Case) -> None:
    record = run(replace(case, adapter="tests.client.dies_at_import:Nothing"))
    assert record.error is not None
    assert (record.error.type, record.error.phase) == ("WorkerExited", "launch")
    assert "exited with status 3" in record.error.message


def test_wrong_interpreter(case: Case) -> None:
    record = run(replace(case, python="/nowhere/python"))
    assert record.error is not None
    assert record.error.type == "WorkerStartError"
    assert "/nowhere/python" in record.error.message
    assert "--sim-python" in record.error.message


@pytest.mark.parametrize(
    "script",
    ['#!/bin/sh\necho garbage\nexec {python} "$@"\n', "#!/bin/sh\nsleep 60\n", "#!/bin/sh\n"],
    ids=["prints garbage", "never answers", "ends at once"],
)
def test_interpreter_that_is_none(case: Case, tmp_path: Path, script: str) -> None:
    wrapper = tmp_path / "python"
    wrapper.write_text(script.format(python=sys.executable))
    wrapper.chmod(wrapper.stat().st_mode | stat.S_IEXEC)
    record = run(replace(case, python=str(wrapper), stall_timeout=3.0))
    assert record.error is not None
    assert record.error.type == "WorkerStartError"
    assert str(wrapper) in record.error.message


def test_no_display(engine: Case) -> None:
    display = {"DISPLAY": ":4711"}  # nobody serves it
    record = run(replace(engine, mode="gui", environment=display))
    assert record.error is not None
    assert (record.error.type, record.error.phase) == ("WorkerExited", "load")
    assert re.search("display|X server", record.error.log_tail)


def test_missing_engine_module(case: Case) -> None:
    record = run(replace(case, adapter="tests.client.no_such_module:Nothing"))
    assert record.error is not None
    assert "no_such_module" in record.error.message


def test_another_world_stops_the_run(engine: Case) -> None:
    kept: list[Record] = []
    case = faulty(engine, "WrongGravity")

    with pytest.raises(Exception, match=f"gravity: scene .*-9.80665.*{case.simulator} .*-20"):
        Repeater(Experiment(case, Falling()), LocalExecutor(1), Silent(), kept.append).run(
            range(1, 4)
        )  # type: ignore[arg-type]
    assert [record.error.type for record in kept if record.error] == ["WorldParityError"]


def test_full_disk_for_logs_does_not_stop_the_repetition(engine: Case, tmp_path: Path) -> None:
    (tmp_path / "full").symlink_to("/dev/full")
    record = run(replace(engine, folder=tmp_path / "full"))
    assert record.status == "ok"
    assert os.path.islink(tmp_path / "full")
