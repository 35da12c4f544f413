"""Repetitions that begin before their test does, where a slot is free."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import pytest

from pytest_simbench.client.errors import Interrupted
from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.executor import LocalExecutor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.tasks.base import Count, Outcome
from tests.tiny import Falling

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
