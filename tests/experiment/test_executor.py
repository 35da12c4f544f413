"""The queue of a machine: who gets a slot, workers that serve several repetitions, prefetching."""

from __future__ import annotations

import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import ClassVar

import pytest

from pytest_simbench.client.errors import ExecutorError, Interrupted, Where
from pytest_simbench.client.process import WorkerProcess
from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.executor import LocalExecutor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.experiment.slots import NOW, Slots, key_of, slot
from pytest_simbench.experiment.workers import IdleWorkers
from pytest_simbench.records.record import Record
from pytest_simbench.tasks.base import Count, Jitter, Outcome
from tests.client.faulty import COMPILE_SECONDS
from tests.conftest import workers
from tests.tiny import Falling


@pytest.fixture
def slots() -> Iterator[Slots]:
    found = Slots(1)
    yield found
    found.close()


def held_for(slots: Slots, test: str, seconds: float) -> None:
    with slot(slots.address, test, lambda: False) as granted:
        assert granted
        time.sleep(seconds)


def test_the_unknown_come_first_then_the_longest_and_what_no_test_wants_last(
    slots: Slots,
) -> None:
    slots._ended |= {NOW + key_of("long"): (10, 600.0), NOW + key_of("short"): (100, 1000.0)}
    order: list[str] = []

    def wait(test: str) -> None:
        with slot(slots.address, test, lambda: False, later=test == "later"):
            order.append(test)

    names = ["later", "short", "long", "new", "short", "long"]
    waiting = [threading.Thread(target=wait, args=(name,)) for name in names]
    with slot(slots.address, "first", lambda: False):
        for thread in waiting:
            thread.start()
        while len(slots._waiting) < len(names):
            time.sleep(0.01)
        assert not order
    for thread in waiting:
        thread.join()
    assert order == ["new", "long", "long", "short", "short", "later"]


def test_it_is_told_how_long_a_repetition_took(slots: Slots) -> None:
    held_for(slots, "mine", 0.1)
    held_for(slots, "other", 0.0)  # now the end of the first was heard
    assert 0.1 <= slots._rank(NOW + key_of("mine"))[1] < float("inf")


def test_a_process_that_is_killed_gives_its_slot_back(slots: Slots) -> None:
    code = (
        "import socket, sys, time; found = socket.socket(socket.AF_UNIX); "
        "found.connect(chr(0) + sys.argv[1]); found.send(b'n' * 17); print(found.recv(1)); "
        "sys.stdout.flush(); time.sleep(600)"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code, slots.address], stdout=subprocess.PIPE
    ) as other:
        other.stdout.readline()
        looks = iter([False, False, True])
        with slot(slots.address, "mine", lambda: next(looks)) as granted:
            assert not granted  # it waited, and was stopped
        other.kill()
    held_for(slots, "mine", 0.0)


def test_who_waits_hears_that_the_run_is_gone(slots: Slots) -> None:
    with slot(slots.address, "held", lambda: False):
        threading.Timer(0.1, slots.close).start()
        with (
            pytest.raises(ExecutorError, match="is gone"),
            slot(slots.address, "mine", lambda: False),
        ):
            pass
    with pytest.raises(ExecutorError, match="is gone"), slot(slots.address, "x", lambda: False):
        pass


def test_who_was_heard_by_nobody_hears_that_the_run_is_gone() -> None:
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind("")  # an address of its own, that of Linux's abstract names
        listener.listen()
        address = listener.getsockname()[1:].decode()
        threading.Timer(0.1, listener.close).start()
        with (
            pytest.raises(ExecutorError, match="is gone"),
            slot(address, "mine", lambda: False),
        ):
            pass


MET = threading.Barrier(2)
FIRST, LAST = "first", "last"


@dataclass(frozen=True)
class Meeting(Falling):
    """Ends when two of them are under way, or the test's time is over."""

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        MET.wait(30.0)
        return super().perform(world, seed, count)


UNDER_WAY: list[int] = []
MOST: list[int] = []


@dataclass(frozen=True)
class Counted(Falling):
    """Notes how many of them are under way."""

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        UNDER_WAY.append(seed)
        MOST.append(len(UNDER_WAY))
        time.sleep(1.0)  # longer than others take to start
        try:
            return super().perform(world, seed, count)
        finally:
            UNDER_WAY.pop()


def of(case: Case, test: str, task: Falling, profile: str = "tuned") -> Experiment:
    return Experiment(replace(case, test=test, profile=profile), task)


Make = Callable[..., LocalExecutor]


@pytest.fixture
def executor() -> Iterator[Make]:
    """Makes one of two slots; nothing of it is left at the end."""
    made: list[LocalExecutor] = []

    def make(*expected: Experiment) -> LocalExecutor:
        made.append(LocalExecutor(2, expected=expected))
        return made[-1]

    yield make
    for executor in made:
        executor.close()
    assert not [t for t in threading.enumerate() if t.name.startswith("simbench-prefetch")]


def test_the_last_ones_run_beside_the_first(case: Case, executor: Make) -> None:
    one, two = of(case, FIRST, Meeting()), of(case, LAST, Meeting(), "default")
    both = executor(one, two)
    for experiment in (one, two):  # each waits for the other one
        record, error = both.repetition(experiment, 1).run()
        assert error is None
        assert (record.test, record.status) == (experiment.case.test, "ok")
        assert record.profile == experiment.case.profile
        assert record.contended


def test_what_is_asked_for_otherwise_is_carried_out_as_asked(case: Case, executor: Make) -> None:
    one, two = of(case, FIRST, Falling()), of(case, LAST, Falling(), "default")
    both = executor(one, two)
    both.repetition(one, 1).run()
    other = of(case, LAST, Falling(duration=0.3), "default")
    record, _ = both.repetition(other, 1).run()
    assert record.stepping["simulated"] == pytest.approx(0.3)
    second, _ = both.repetition(two, 2).run()
    assert second.seed == two.seed(2)


def test_nothing_begins_ahead_that_a_test_has_come_to(case: Case, executor: Make) -> None:
    tests = [of(case, f"{FIRST} {k}", Falling()) for k in range(3)]
    both = executor(*tests)
    records = [both.repetition(test, 1).run()[0] for test in tests]
    assert [record.reused_worker for record in records] == [
        k > 0 and test.reuses_worker for k, test in enumerate(tests)
    ]


def test_a_test_of_many_repetitions_shares_the_slots_with_what_has_begun(
    case: Case, executor: Make
) -> None:
    """Two at once, whoever asked for them."""
    MOST.clear()
    one, two = of(case, FIRST, Counted()), of(case, LAST, Counted(), "default")
    both = executor(one, two)
    with ThreadPoolExecutor(3) as threads:
        repetitions = [both.repetition(one, k) for k in (1, 2, 3)]
        ended = list(threads.map(lambda repetition: repetition.run(), repetitions))
    ended.append(both.repetition(two, 1).run())
    assert [record.status for record, _ in ended] == ["ok"] * 4
    assert max(MOST) <= 2


def test_one_that_waits_for_a_slot_can_be_ended(case: Case, executor: Make) -> None:
    both = executor()
    long = of(case, FIRST, Falling(duration=1e5))
    held = [both.repetition(long, k) for k in (1, 2)]
    waiting = both.repetition(long, 3)
    with ThreadPoolExecutor(3) as threads:
        running = [threads.submit(repetition.run) for repetition in held]
        while sum(repetition._process is not None for repetition in held) < 2:  # type: ignore[attr-defined]
            time.sleep(0.01)
        last = threads.submit(waiting.run)
        waiting.kill()
        with pytest.raises(Interrupted):
            last.result(timeout=10.0)
        for repetition in held:
            repetition.kill()
        assert [r.result()[0].status for r in running] == ["interrupted"] * 2


def test_the_end_kills_what_nobody_has_asked_for(case: Case, executor: Make) -> None:
    one, two = of(case, FIRST, Falling()), of(case, LAST, Falling(duration=1e4), "default")
    both = executor(one, two, of(case, "more", Falling(duration=2e4), "default"))
    assert both.repetition(one, 1).run()[1] is None


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
    assert (record.error.type, record.error.phase) == ("WorkerHung", "compiling")


def test_a_world_that_does_not_start_anew_is_refused(case: Case, idle: IdleWorkers) -> None:
    case = costly(case, "Restless")
    first, second = run(case, idle, 1), run(case, idle, 2)
    assert first.status == "ok"
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
