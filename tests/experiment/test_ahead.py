"""Repetitions that begin before their test does."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import dataclass, replace

import pytest

from pytest_simbench.client.world import World
from pytest_simbench.experiment.ahead import AheadExecutor
from pytest_simbench.experiment.case import Case
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


def of(case: Case, test: str, task: Falling, profile: str = "tuned") -> Experiment:
    return Experiment(replace(case, test=test, profile=profile), task)


@pytest.fixture
def executors() -> Iterator[list[AheadExecutor]]:
    made: list[AheadExecutor] = []
    yield made
    for executor in made:
        executor.close()
    assert not [t for t in threading.enumerate() if t.name.startswith("simbench-ahead")]


def test_the_last_ones_run_beside_the_first(case: Case, executors: list[AheadExecutor]) -> None:
    one, two = of(case, FIRST, Meeting()), of(case, LAST, Meeting(), "default")
    executor = AheadExecutor(2, [one, two])
    executors.append(executor)
    for experiment in (one, two):  # each waits for the other one
        record, error = executor.repetition(experiment, 1).run()
        assert error is None
        assert (record.test, record.status) == (experiment.case.test, "ok")
        assert record.profile == experiment.case.profile
        assert record.contended


def test_what_is_asked_for_otherwise_is_carried_out_as_asked(
    case: Case, executors: list[AheadExecutor]
) -> None:
    one, two = of(case, FIRST, Falling()), of(case, LAST, Falling(), "default")
    executor = AheadExecutor(2, [one, two])
    executors.append(executor)
    executor.repetition(one, 1).run()
    other = of(case, LAST, Falling(duration=0.3), "default")
    record, _ = executor.repetition(other, 1).run()
    assert record.stepping["simulated"] == pytest.approx(0.3)
    second, _ = executor.repetition(two, 2).run()
    assert second.seed == two.seed(2)


def test_nothing_begins_ahead_that_a_test_has_come_to(
    case: Case, executors: list[AheadExecutor]
) -> None:
    tests = [of(case, f"{FIRST} {k}", Falling()) for k in range(3)]
    executor = AheadExecutor(2, tests)
    executors.append(executor)
    records = [executor.repetition(test, 1).run()[0] for test in tests]
    assert [record.reused_worker for record in records] == [
        k > 0 and test.reuses_worker for k, test in enumerate(tests)
    ]


def test_the_end_kills_what_nobody_has_asked_for(
    case: Case, executors: list[AheadExecutor]
) -> None:
    one, two = of(case, FIRST, Falling()), of(case, LAST, Falling(duration=1e4), "default")
    more = of(case, "more", Falling(duration=2e4), "default")
    executor = AheadExecutor(2, [one, two, more])
    executors.append(executor)
    assert executor.repetition(one, 1).run()[1] is None
