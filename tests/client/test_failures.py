"""Every way in which a worker can fail, on real processes: typed error, record, next repetition."""

from __future__ import annotations

import os
import re
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import pytest

from pytest_simbench.client.answers import ANSWERS
from pytest_simbench.client.errors import Unavailable, exit_text
from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.executor import LocalExecutor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repeater import Repeater
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.records.record import Record
from pytest_simbench.tasks import LeaningTowers
from pytest_simbench.tasks.base import Count, Outcome
from pytest_simbench.worker.server import Server
from pytest_simbench.worker.wire import LONGEST_LOGGED
from tests.client.failing import Silent, failure, faulty, run
from tests.client.faulty import RAISED
from tests.conftest import ADAPTERS
from tests.tiny import Falling


@pytest.fixture(params=["mujoco", "pybullet"])
def engine(case: Case, request: pytest.FixtureRequest) -> Case:
    """The case on each engine."""
    return replace(case, simulator=request.param, adapter=ADAPTERS[request.param])


def with_fault(case: Case, fault: str, **changes: Any) -> Case:
    """The case on the same engine with a fault."""
    engine = case.adapter.rpartition(":")[2]
    return faulty(case, f"{engine}_{fault}", **{"stall_timeout": 20.0, **changes})


@pytest.mark.parametrize(
    ("fault", "kind", "message"),
    [
        ("Killed", "WorkerExited", "was killed by SIGKILL"),
        ("Crashed", "WorkerExited", "was killed by SIGSEGV"),
        ("Stopped", "WorkerHung", "no sign of life"),
        ("Hung", "WorkerHung", "no sign of life"),
        ("Raising", "EngineFailed", "ValueError: the engine is unhappy"),
        ("NotANumber", "Diverged", "not finite at t = 0.3"),
    ],
)
def test_fault_while_stepping(engine: Case, fault: str, kind: str, message: str) -> None:
    found, phase, said = failure(with_fault(engine, fault, stall_timeout=3.0))
    assert (found, phase) == (kind, "fall")
    assert message in said
    assert run(engine, number=2).metrics == {"landed": 1.0}


CAUSES = [
    # what an adapter raises; whatever else it may be, tests/worker/test_server.py
    ("Raises surrogate", "EngineFailed", "fall", "ValueError: bad \\ud800 text"),
    ("Raises huge", "EngineFailed", "fall", f"{'y' * 50} ... (4998000 more characters)"),
    ("Raises exit", "WorkerExited", "fall", "the adapter called sys.exit(3)"),
    ("Raises parity", "WorldParityError", "fall", "... (16000 more characters)"),
    # how its process ends
    ("ExitsLoading", "WorkerExited", "load", "the adapter called sys.exit(5)"),
    ("ExitsAtOnce", "WorkerExited", "fall", "the worker exited with status 7"),
    ("Aborts", "WorkerExited", "fall", "the worker was killed by SIGABRT"),
    # what it says, of another type than it must be
    ("Lies versions", "ProtocolError", "launch",
     "Expected `str`, got `null` - at `$.versions[...]`"),
    ("Lies names of versions", "ProtocolError", "launch", "got `int` - at `key` in `$.versions`"),
    ("Lies untested", "ProtocolError", "launch", "Expected `str`, got `int` - at `$.untested`"),
    ("Lies settings", "ProtocolError", "launch", "got `int` - at `key` in `$.settings`"),
    ("Lies deviations", "ProtocolError", "load", "Expected `str`, got `int` - at `$.excused["),
    ("Lies no dict of versions", "EngineFailed", "launch", "'int' object has no attribute 'get'"),
    ("Lies bodies", "BadState", "load",
     "mujoco: body_state() must be an array of float64 (2, 13), not float64 (1, 13)"),
    ("Lies time", "BadState", "fall", "steps of 0.001 s from 0 s on, not 0.3 s"),
    ("Lies versions that cannot be sent", "EngineFailed", "launch", "DumpError"),
    ("Forks", "ProtocolError", "task", "engine forks and its child answers"),
]  # fmt: skip


@pytest.mark.parametrize(("fault", "kind", "phase", "message"), CAUSES, ids=[c[0] for c in CAUSES])
def test_the_cause_arrives(case: Case, fault: str, kind: str, phase: str, message: str) -> None:
    began = time.monotonic()
    found = failure(faulty(case, fault, stall_timeout=20.0))
    assert time.monotonic() - began < 10.0
    assert found[:2] == (kind, phase)
    assert message in found[2]


def test_a_world_that_cannot_be_is_not_scored(case: Case) -> None:
    case = faulty(case, "Flying", stall_timeout=20.0)
    kind, phase, said = failure(case, LeaningTowers(margins=(0.015,)))
    assert (kind, phase) == ("Diverged", "settle")
    assert "'cube_01' left the room" in said


CTRL_C = "exec {python} -c 'from signal import *; signal(SIGINT, SIG_DFL); raise_signal(SIGINT)'"
"""Meets a worker that has no session of its own yet. Shells in the background ignore it."""


@pytest.mark.parametrize(
    ("script", "kind", "message"),
    [
        ('echo garbage\nexec {python} "$@"', "WorkerStartError", "{wrapper}"),
        ("sleep 60", "WorkerStartError", "{wrapper}"),
        ("", "WorkerStartError", "{wrapper}"),
        ("exit 127", "WorkerStartError", "it exited with status 127"),
        ("kill -KILL $$", "WorkerExited", "the worker was killed by SIGKILL"),
        ("kill -SEGV $$", "WorkerExited", "the worker was killed by SIGSEGV"),
        (CTRL_C, "Interrupted", "the run was interrupted"),
    ],
    ids=["garbage", "no answer", "at once", "status", "KILL", "SEGV", "INT"],
)
def test_an_interpreter_that_is_none(
    case: Case, tmp_path: Path, script: str, kind: str, message: str
) -> None:
    wrapper = tmp_path / "python"
    wrapper.write_text(
        f"#!/bin/sh\necho no such library >&2\n{script.format(python=sys.executable)}"
    )
    wrapper.chmod(0o755)
    record = run(replace(case, python=str(wrapper), stall_timeout=3.0))
    assert (record.error.type, record.error.phase) == (kind, "launch")
    assert message.format(wrapper=wrapper) in record.error.message
    assert record.error.log_tail == "no such library"


@pytest.mark.parametrize(
    ("changes", "kind", "words"),
    [
        ({"adapter": "tests.client.dies_at_import:Nothing"}, "WorkerExited", ["with status 3"]),
        ({"adapter": "tests.client.nowhere:Nothing"}, "EngineFailed", ["tests.client.nowhere"]),
        ({"python": "/nowhere/python"}, "WorkerStartError", ["/nowhere/python", "--sim-python"]),
    ],
)
def test_what_cannot_be_started(
    case: Case, changes: dict[str, Any], kind: str, words: list[str]
) -> None:
    found = failure(replace(case, **changes))
    assert found[:2] == (kind, "launch")
    assert all(word in found[2] for word in words)


def test_the_log_tail_shows_where_it_crashed(engine: Case) -> None:
    record = run(with_fault(engine, "Crashed"))
    assert "Segmentation fault" in record.error.log_tail
    assert "in crash" in record.error.log_tail


def test_a_worker_that_eats_memory_is_killed(engine: Case) -> None:
    record = run(with_fault(engine, "Greedy", memory_limit=500.0))
    assert record.error.type == "OutOfMemory"
    assert "limit of 500 MB" in record.error.message
    assert record.resources["rss_mb"]["peak"] > 500


def test_a_repetition_times_out(engine: Case) -> None:
    record = run(with_fault(engine, "Hung", timeout=2.0))
    assert (record.status, record.error.type) == ("failed", "RepetitionTimeout")
    assert "--sim-timeout" in record.error.message
    # Its own time-out ended it, neither the task's (60 s) nor the limit of silence (20 s).
    assert 2.0 <= record.seconds["total"] < engine.stall_timeout


def test_garbage_on_stdout_harms_nothing(engine: Case) -> None:
    record = run(with_fault(engine, "Chatty"))
    assert (record.status, record.metrics) == ("ok", {"landed": 1.0})


def test_crash_while_closing_does_not_fail_a_finished_repetition(engine: Case) -> None:
    record = run(with_fault(engine, "CrashesClosing"))
    assert record.status == "ok"
    assert "SIGSEGV" in record.notes.closing


def test_no_display(engine: Case) -> None:
    display = {"DISPLAY": ":4711"}  # nobody serves it
    record = run(replace(engine, mode="gui", environment=display))
    assert (record.error.type, record.error.phase) == ("WorkerExited", "load")
    assert re.search("display|X server", record.error.log_tail)


def test_another_world_stops_the_run(engine: Case) -> None:
    kept: list[Record] = []
    case = with_fault(engine, "WrongGravity")
    repeater = Repeater(Experiment(case, Falling()), LocalExecutor(), Silent(), kept.append)
    with pytest.raises(Exception, match=f"gravity: scene .*-9.80665.*{case.simulator} .*-20"):
        repeater.run(range(1, 4))
    assert [record.error.type for record in kept if record.error] == ["WorldParityError"]


def test_full_disk_for_logs_does_not_stop_the_repetition(engine: Case, tmp_path: Path) -> None:
    (tmp_path / "full").symlink_to("/dev/full")
    record = run(replace(engine, folder=tmp_path / "full"))
    assert record.status == "ok"
    assert os.path.islink(tmp_path / "full")


def test_the_log_holds_more_of_a_long_message(case: Case) -> None:
    run(faulty(case, "Raises huge", stall_timeout=20.0))
    (log,) = (case.folder / "logs").iterdir()
    assert LONGEST_LOGGED <= log.stat().st_size < 2 * LONGEST_LOGGED


def test_an_adapter_s_own_kind_of_an_error_of_ours(case: Case) -> None:
    case = faulty(case, "Raises derived", stall_timeout=20.0)
    _, error = Repetition(Experiment(case, Falling()), 1).run()
    assert isinstance(error, Unavailable)


@dataclass(frozen=True)
class Failing(Falling):
    """A task whose own code fails, with an exception of `RAISED`."""

    name: ClassVar[str] = "failing"

    fault: str = ""

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        raise RAISED[self.fault]()


@pytest.mark.parametrize("fault", ["surrogate", "huge", "no_text"])
def test_a_task_that_fails_is_recorded_too(case: Case, fault: str) -> None:
    failure(case, Failing(fault=fault))


def test_a_path_with_two_slashes(case: Case) -> None:
    """They end a part of an execnet specification."""
    python = sys.executable.replace("/", "//")
    record = run(replace(case, python=python, environment={"SOMETHING": "a//b"}))
    assert record.status == "ok"


def test_every_request_has_its_type() -> None:
    assert {f"do_{name}" for name in ANSWERS} == {n for n in dir(Server) if n.startswith("do_")}


def test_words() -> None:
    assert exit_text(139) == "exited with status 139, a shell's word for SIGSEGV"
    assert exit_text(3) == "exited with status 3"
    assert exit_text(-9) == "was killed by SIGKILL"
