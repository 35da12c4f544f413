"""Workers that serve several repetitions, where starting is costly."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import pytest

from pytest_simbench.client.errors import Where
from pytest_simbench.client.process import WorkerProcess
from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.executor import LocalExecutor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.experiment.workers import IdleWorkers
from pytest_simbench.records.record import Record
from pytest_simbench.tasks.base import Jitter
from tests.client.faulty import COMPILE_SECONDS
from tests.conftest import workers
from tests.tiny import Falling


@pytest.fixture
def idle() -> Iterator[IdleWorkers]:
    idle = IdleWorkers()
    yield idle
    idle.close()


def costly(case: Case, fault: str = "Costly", timeout: float = 60.0) -> Case:
    return replace(
        case,
        adapter=f"tests.client.faulty:MuJoCo_{fault}",
        costly_start=True,
        compile_timeout=timeout,
    )


def run(case: Case, idle: IdleWorkers, number: int = 1) -> Record:
    return Repetition(Experiment(case, Falling()), number, idle=idle).run()[0]


def results(record: Record) -> object:
    return record.metrics, record.seed, record.stepping["simulated"], record.stepping["steps"]


def test_one_worker_serves_all_and_gives_what_fresh_ones_give(
    case: Case, idle: IdleWorkers
) -> None:
    case = costly(case)
    reused = [run(case, idle, number) for number in (1, 2, 3)]
    fresh = [run(replace(case, fresh=True), idle, number) for number in (1, 2, 3)]
    assert [r.reused_worker for r in reused] == [False, True, True]
    assert [r.reused_worker for r in fresh] == [False, False, False]
    assert [results(r) for r in reused] == [results(r) for r in fresh]


def test_compiling_is_a_phase_of_its_own(case: Case, idle: IdleWorkers) -> None:
    first, again = run(costly(case), idle), run(costly(case), idle, 2)
    assert (first.status, again.status) == ("ok", "ok")
    assert first.seconds["compile"] >= COMPILE_SECONDS
    assert again.seconds["compile"] < COMPILE_SECONDS
    parts = sum(seconds for kind, seconds in first.seconds.items() if kind != "total")
    assert parts == pytest.approx(first.seconds["total"], abs=0.01)


def test_compiling_does_not_count_against_the_time_out(case: Case) -> None:
    case = costly(case)
    process = WorkerProcess(case.launch("deadline"), Where(case.simulator, case.mode))
    try:
        process.construct(timeout=30.0)
        process.deadline = before = time.monotonic() + 100.0
        World(process, Falling().scene(1, Jitter()))
        assert process.deadline >= before + COMPILE_SECONDS
    finally:
        process.close()


def test_a_compilation_that_never_ends(case: Case, idle: IdleWorkers) -> None:
    record = run(costly(case, "NeverCompiled", timeout=1.0), idle)
    assert record.error is not None
    assert (record.error.type, record.error.phase) == ("WorkerHung", "compiling")


def test_a_world_that_does_not_start_anew_is_refused(case: Case, idle: IdleWorkers) -> None:
    case = costly(case, "Restless")
    first, second = run(case, idle, 1), run(case, idle, 2)
    assert first.status == "ok"
    assert second.error is not None
    assert second.error.type == "WorldParityError"
    assert "start" in second.error.message


def test_the_dead_are_not_kept(case: Case, idle: IdleWorkers) -> None:
    before = workers()
    run(costly(case), idle)
    for worker in workers() - before:
        worker.kill()
        worker.wait()
    record = run(costly(case), idle, 2)
    assert (record.status, record.reused_worker) == ("ok", False)


def test_closing_ends_them(case: Case) -> None:
    idle = IdleWorkers()
    before = workers()
    run(costly(case), idle)
    assert workers() - before
    idle.close()
    assert not workers() - before


@dataclass(frozen=True)
class Sharing(Falling):
    """Shorter than the start of a worker."""

    shares_worker: ClassVar[bool] = True


def test_tests_of_short_tasks_share_a_worker_of_any_engine(case: Case) -> None:
    executor = LocalExecutor()

    def reused(case: Case, task: Falling) -> bool:
        record, error = executor.repetition(Experiment(case, task), 1).run()
        executor.end_test()
        assert (record.status, error) == ("ok", None)
        return record.reused_worker

    before = workers()
    assert [reused(case, Sharing()) for _ in range(3)] == [False, True, True]
    assert not reused(replace(case, fresh=True), Sharing())
    assert not reused(replace(case, environment={"OTHER": "1"}), Sharing())
    assert not reused(case, Falling())
    assert not reused(case, Sharing())
    executor.close()
    assert not workers() - before
