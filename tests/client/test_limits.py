"""No wait for a worker is without a limit, and Ctrl-C works in each; a full machine is told."""

from __future__ import annotations

import _thread
import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from pytest_simbench.client.launch import KEPT, LARGEST
from pytest_simbench.client.process import WorkerProcess
from pytest_simbench.client.resources import crowding, scheduled
from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.executor import LocalExecutor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.handle import SimulatorHandle
from pytest_simbench.experiment.interrupts import Interrupts
from pytest_simbench.experiment.repeater import Repeater
from pytest_simbench.records.record import Record
from pytest_simbench.tasks.base import Count, Jitter, Outcome
from tests.client.failing import STALL, Silent, failure, faulty, run
from tests.conftest import workers
from tests.tiny import Falling
from tests.worker.test_control import busy_machine

DEADLINE = 5.0
"""Of a repetition [s]."""

SLACK = 4.0
"""Wall time that noticing, killing and recording may take on a busy machine [s]."""


@dataclass(frozen=True)
class Sending(Falling):
    """Sends more than any pipe holds, after a moment in which the worker can freeze."""

    name: ClassVar[str] = "sending"

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        time.sleep(0.6)
        with world.phase("send"):
            world.process.request("read_back", ballast=np.zeros(4_000_000))
        return Outcome()


@contextmanager
def at_most(seconds: float) -> Iterator[None]:
    began, before = time.monotonic(), workers()
    yield
    assert time.monotonic() - began < seconds + SLACK
    assert not workers() - before


@pytest.mark.parametrize("fault", ["StopsBetweenRequests", "HoldsTheInterpreter"])
def test_sending_to_a_worker_that_does_not_read(case: Case, fault: str) -> None:
    with at_most(1.5 + STALL):
        kind, phase, message = failure(faulty(case, fault), Sending())
    assert (kind, phase) == ("WorkerHung", "send")
    assert "for 2 s" in message
    assert "--sim-stall-timeout" in message


def test_sending_has_the_repetition_s_time_out_too(case: Case) -> None:
    case = faulty(case, "StopsBetweenRequests", stall_timeout=60.0, timeout=DEADLINE)
    with at_most(DEADLINE):
        kind, phase, message = failure(case, Sending())
    assert (kind, phase) == ("RepetitionTimeout", "send")
    assert "--sim-timeout" in message


def test_signs_of_life_do_not_put_off_the_repetition_s_time_out(case: Case) -> None:
    with at_most(DEADLINE):
        kind, phase, _ = failure(faulty(case, "Chatters", timeout=DEADLINE))
    assert (kind, phase) == ("RepetitionTimeout", "fall")


@pytest.mark.parametrize(
    ("fault", "kind", "phase"),
    [
        ("StopsBeingMade", "WorkerHung", "launch"),
        ("StopsLoading", "WorkerHung", "load"),
        ("HalfAnswer", "WorkerHung", "fall"),
        ("HangsUp", "WorkerExited", "fall"),
        ("Garbage", "WorkerExited", "fall"),
    ],
)
def test_silence_and_nonsense_end_by_the_stall_limit(
    case: Case, fault: str, kind: str, phase: str
) -> None:
    with at_most(1.5 + STALL):
        assert failure(faulty(case, fault), Falling(1e6))[:2] == (kind, phase)


def test_a_worker_that_does_not_close(case: Case) -> None:
    record = run(faulty(case, "StopsClosing"))
    assert record.status == "ok"
    assert record.notes.closing == "the worker did not close within 10 s"


def test_a_log_does_not_fill_the_disk(case: Case) -> None:
    assert failure(faulty(case, "FloodsTheLog", stall_timeout=3.0))[0] == "WorkerHung"
    (log,) = (case.folder / "logs").iterdir()
    assert log.stat().st_size < LARGEST


def test_a_log_is_cut_though_it_grew_at_once(case: Case) -> None:
    assert run(faulty(case, "FloodsAtOnce")).status == "ok"
    (log,) = (case.folder / "logs").iterdir()
    assert log.stat().st_size < 2 * KEPT


def interrupt_after(seconds: float, times: int = 1, apart: float = 0.0) -> threading.Thread:
    """Ctrl-C, as the kernel would deliver it to this process."""

    def work() -> None:
        time.sleep(seconds)
        for _ in range(times):
            _thread.interrupt_main()
            time.sleep(apart)

    thread = threading.Thread(target=work)
    thread.start()
    return thread


def kept(case: Case, task: Falling, jobs: int = 1, last: int = 1) -> tuple[list[Record], bool]:
    """Records of a run, and whether Ctrl-C got out of it."""
    records: list[Record] = []
    try:
        Repeater(Experiment(case, task), LocalExecutor(jobs), Silent(), records.append).run(
            range(1, last + 1)
        )
    except KeyboardInterrupt:
        return records, True
    return records, False


@pytest.mark.parametrize("jobs", [1, 2])
@pytest.mark.parametrize(
    ("fault", "task"),
    [
        ("StopsBetweenRequests", Sending()),
        ("HoldsTheInterpreter", Sending()),
        ("StopsLoading", Falling()),
        ("Chatters", Falling()),
    ],
)
def test_interrupt(case: Case, fault: str, task: Falling, jobs: int) -> None:
    case = faulty(case, fault, stall_timeout=60.0)
    thread = interrupt_after(4.0)
    with at_most(4.0):
        records, raised = kept(case, task, jobs, last=jobs)
    thread.join()
    assert raised
    assert [record.status for record in records] == ["interrupted"] * jobs


@pytest.mark.parametrize("jobs", [1, 2])
def test_interrupt_while_starting(case: Case, jobs: int) -> None:
    never = case.folder / "python"
    never.write_text("#!/bin/sh\nsleep 600\n")
    never.chmod(0o755)
    case = replace(case, python=str(never), stall_timeout=60.0)
    thread = interrupt_after(1.0)
    with at_most(1.0):
        records, raised = kept(case, Falling(), jobs, last=jobs)
    thread.join()
    assert raised
    assert [(r.status, r.error.phase) for r in records if r.error] == [
        ("interrupted", "launch")
    ] * jobs
    assert not any("python" in record.versions for record in records)  # so it can be resumed


@pytest.mark.parametrize("apart", [0.0, 0.002, 0.02, 0.1])
@pytest.mark.parametrize("jobs", [1, 2])
def test_two_interrupts_lose_no_record(case: Case, jobs: int, apart: float) -> None:
    thread = interrupt_after(2.0, times=5, apart=apart)
    records, raised = [], False
    try:
        records, raised = kept(case, Falling(1e6), jobs, last=jobs)
        thread.join()
    except KeyboardInterrupt:  # one of the later ones, when the records were kept
        raised = True
    thread.join()
    assert raised
    assert [record.status for record in records] == ["interrupted"] * jobs


def test_an_interrupt_while_the_record_is_kept(case: Case) -> None:
    records: list[Record] = []

    def keep(record: Record) -> None:
        _thread.interrupt_main()
        time.sleep(0.05)
        records.append(record)

    with pytest.raises(KeyboardInterrupt):
        Repeater(Experiment(case, Falling()), LocalExecutor(1), Silent(), keep).run([1, 2])
    assert [record.status for record in records] == ["ok"]


def test_an_interrupt_while_the_worker_is_ended(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The worst moment for the second one: the first has been caught, and nothing is written."""
    kill = WorkerProcess.kill

    def interrupted(process: WorkerProcess) -> None:
        _thread.interrupt_main()
        time.sleep(0.05)
        kill(process)

    monkeypatch.setattr(WorkerProcess, "kill", interrupted)
    thread = interrupt_after(2.0)
    records, raised = kept(case, Falling(1e6))
    thread.join()
    assert raised
    assert [record.status for record in records] == ["interrupted"]


def test_a_time_out_is_a_failure_also_while_the_run_is_interrupted(case: Case) -> None:
    """What Ctrl-C ended is interrupted, and only that."""
    records: list[Record] = []

    class Stopping(Silent):
        def phase(self, name: str) -> None:
            if name == "fall":
                repeater._stopping.set()  # Ctrl-C came, and has not reached this worker yet

    experiment = Experiment(replace(case, timeout=3.0), Falling(1e6))
    repeater = Repeater(experiment, LocalExecutor(2), Stopping(), records.append)
    repeater.run([1])
    assert [(r.status, r.error and r.error.type) for r in records] == [
        ("failed", "RepetitionTimeout")
    ]


def test_an_episode_has_the_time_out_that_was_given(case: Case) -> None:
    handle = SimulatorHandle(faulty(case, "Chatters", timeout=3.0, stall_timeout=60.0))
    scene = Falling().scene(1, Jitter())
    with at_most(5.0):
        with pytest.raises(Exception, match="--sim-timeout"), handle.episode(scene) as world:
            world.wait(1.0)
        handle.close()


def test_signals_reach_their_handler_when_the_block_ends() -> None:
    with pytest.raises(KeyboardInterrupt), Interrupts() as interrupts:  # noqa: PT012
        interrupts.hold()
        _thread.interrupt_main()
        reached = True
    assert reached


class Crowded(Falling):
    """Falls for ever, on a core that is shared with four others once the world is there."""

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        pid = world.process.pid
        core = min(os.sched_getaffinity(pid))
        os.sched_setaffinity(pid, {core})
        with busy_machine(4, "taskset", "-c", str(core)), world.phase("fall"):
            world.wait(1e6)
        return Outcome()


def threads(proc: Path, *stats: str) -> None:
    for number, stat in enumerate(stats):
        folder = proc / "7" / "task" / str(number)
        folder.mkdir(parents=True)
        (folder / "schedstat").write_text(stat)


def test_a_late_worker_on_a_full_core_says_so(case: Case) -> None:
    kind, phase, message = failure(replace(case, timeout=8.0), Crowded())
    assert (kind, phase) == ("RepetitionTimeout", "fall")
    assert "waited" in message
    assert "--sim-jobs" in message


def test_all_threads_count(tmp_path: Path) -> None:
    threads(tmp_path, "3000000000 500000000 12\n", "1000000000 1500000000 5\n")
    assert scheduled(7, tmp_path) == (4.0, 2.0)


@pytest.mark.parametrize("stat", ["", "nothing"])
def test_a_kernel_that_does_not_tell_is_no_full_machine(tmp_path: Path, stat: str) -> None:
    threads(tmp_path, stat)
    assert scheduled(7, tmp_path) == (0.0, 0.0)
    assert scheduled(8, tmp_path) == (0.0, 0.0)


@pytest.mark.parametrize(("waited", "told"), [(2.4, False), (2.6, True)])
def test_a_little_waiting_is_not_told(
    monkeypatch: pytest.MonkeyPatch, waited: float, told: bool
) -> None:
    """A fifth of the time is the limit: 2.5 of 12.5 s."""
    monkeypatch.setattr("pytest_simbench.client.resources.scheduled", lambda pid: (10.0, waited))
    assert bool(crowding(7)) is told
