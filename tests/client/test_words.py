"""What an adapter raises reaches record and reader, short and at once, whatever it is."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import pytest

from pytest_simbench.client.errors import Unavailable, exit_text
from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.tasks.base import Count, Outcome
from pytest_simbench.worker.text import LONGEST, LONGEST_LOGGED, named, readable
from tests.client.test_limits import unruly
from tests.client.unruly import RAISED, Unprintable
from tests.tiny import Falling


def raising(case: Case, fault: str) -> Case:
    return unruly(case, "Raises", environment={"UNRULY": fault}, stall_timeout=20.0)


@pytest.mark.parametrize(
    ("fault", "kind", "message"),
    [
        ("surrogate", "EngineFailed", "ValueError: bad \\ud800 text"),
        ("huge", "EngineFailed", f"{'y' * 50} ... (4998000 more characters)"),
        ("no_text", "EngineFailed", "Unprintable: (its message cannot be read: RuntimeError)"),
        ("exits_in_text", "EngineFailed", "Unspeakable: (its message cannot be read: SystemExit)"),
        ("own_text", "EngineFailed", "OwnText: mine"),
        ("parity_without_text", "WorldParityError", "(its message cannot be read: RuntimeError)"),
        ("exit_without_text", "WorkerExited", "sys.exit('(its message cannot be read: "),
        ("no_string", "EngineFailed", "ValueError: (b'bytes', {1: 2}, None)"),
        ("interrupt", "EngineFailed", "KeyboardInterrupt: from inside"),
        ("generator", "EngineFailed", "GeneratorExit: done"),
        ("rude", "EngineFailed", "Rude: hm"),
        ("exit", "WorkerExited", "the adapter called sys.exit(3)"),
        ("exit_text", "WorkerExited", "the adapter called sys.exit('tired'), status 1"),
        ("parity", "WorldParityError", "... (16000 more characters)"),
    ],
)
def test_the_cause_arrives(case: Case, fault: str, kind: str, message: str) -> None:
    began = time.monotonic()
    record, _ = Repetition(Experiment(raising(case, fault), Falling()), 1).run()
    assert time.monotonic() - began < 10.0
    assert record.status == "failed"
    assert record.error is not None
    assert (record.error.type, record.error.phase) == (kind, "fall")
    assert message in record.error.message
    assert len(record.error.message) < LONGEST + 200
    json.loads(record.to_json())
    record.to_json().encode("utf-8")
    record.error.message.encode("utf-8")
    assert len(record.to_json()) < 30_000


def test_the_log_holds_more_of_a_long_message(case: Case) -> None:
    Repetition(Experiment(raising(case, "huge"), Falling()), 1).run()
    (log,) = (case.folder / "logs").iterdir()
    assert LONGEST_LOGGED <= log.stat().st_size < 2 * LONGEST_LOGGED


def test_an_adapter_s_own_kind_of_an_error_of_ours(case: Case) -> None:
    _, error = Repetition(Experiment(raising(case, "derived"), Falling()), 1).run()
    assert isinstance(error, Unavailable)


@pytest.mark.parametrize(
    ("fault", "phase", "message"),
    [
        ("ExitsLoading", "load", "the adapter called sys.exit(5)"),
        ("ExitsAtOnce", "fall", "the worker exited with status 7"),
        ("Aborts", "fall", "the worker was killed by SIGABRT"),
    ],
)
def test_ends_of_a_process(case: Case, fault: str, phase: str, message: str) -> None:
    record, _ = Repetition(Experiment(unruly(case, fault, stall_timeout=20.0), Falling()), 1).run()
    assert record.error is not None
    assert (record.error.type, record.error.phase) == ("WorkerExited", phase)
    assert record.error.message == message


@dataclass(frozen=True)
class Failing(Falling):
    """A task whose own code fails, with an exception of `RAISED`."""

    name: ClassVar[str] = "failing"

    fault: str = ""

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        raise RAISED[self.fault]()


@pytest.mark.parametrize("fault", ["surrogate", "huge", "no_text"])
def test_a_task_that_fails_is_recorded_too(case: Case, fault: str) -> None:
    record, _ = Repetition(Experiment(case, Failing(fault=fault)), 1).run()
    assert record.status == "failed"
    assert record.error is not None
    record.error.message.encode("utf-8")
    assert 0 < len(record.error.message) < LONGEST + 100


@pytest.mark.parametrize("name", ["KILL", "SEGV", "TERM"])
def test_a_signal_before_the_handshake_is_named(case: Case, tmp_path: Path, name: str) -> None:
    python = tmp_path / "python"
    python.write_text(f"#!/bin/sh\nkill -{name} $$\n")
    python.chmod(0o755)
    record, _ = Repetition(Experiment(replace(case, python=str(python)), Falling()), 1).run()
    assert record.error is not None
    assert (record.error.type, record.error.phase) == ("WorkerExited", "launch")
    assert record.error.message == f"the worker was killed by SIG{name}"


def test_an_interpreter_that_ends_says_how_and_why(case: Case, tmp_path: Path) -> None:
    python = tmp_path / "python"
    python.write_text("#!/bin/sh\necho no such library >&2\nexit 127\n")
    python.chmod(0o755)
    record, _ = Repetition(Experiment(replace(case, python=str(python)), Falling()), 1).run()
    assert record.error is not None
    assert record.error.type == "WorkerStartError"
    assert "it exited with status 127" in record.error.message
    assert record.error.log_tail == "no such library"


def test_a_path_with_two_slashes(case: Case) -> None:
    """They end a part of an execnet specification."""
    import sys

    python = sys.executable.replace("/", "//")
    environment = {"SOMETHING": "a//b"}
    record, _ = Repetition(
        Experiment(replace(case, python=python, environment=environment), Falling()), 1
    ).run()
    assert record.status == "ok"


def test_status_of_a_shell() -> None:
    assert exit_text(139) == "exited with status 139, a shell's word for SIGSEGV"
    assert exit_text(3) == "exited with status 3"
    assert exit_text(-9) == "was killed by SIGKILL"


def test_readable() -> None:
    assert readable("short") == "short"
    assert readable("x" * LONGEST) == "x" * LONGEST
    assert readable("x" * (LONGEST + 1)) == "x" * LONGEST + " ... (1 more characters)"
    assert readable("\ud800") == "\\ud800"
    assert named(Unprintable()) == "Unprintable: (its message cannot be read: RuntimeError)"
    assert named(ValueError()) == "ValueError"
