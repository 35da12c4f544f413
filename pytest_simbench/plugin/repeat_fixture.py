"""The repetitions of one test: those recorded, those to run, and what pytest is told of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import isfinite
from typing import TYPE_CHECKING, Any

import pytest

from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repeater import Repeater
from pytest_simbench.experiment.sequential import Plan, SequentialResultSet
from pytest_simbench.measure.results import ResultSet
from pytest_simbench.plugin import options
from pytest_simbench.plugin.benchmark import worker_clock
from pytest_simbench.plugin.selection import number_mark
from pytest_simbench.records import baseline
from pytest_simbench.records.description import Description
from pytest_simbench.records.record import Record
from pytest_simbench.records.text import in_one_line

if TYPE_CHECKING:
    from pytest_simbench.plugin.run import Run
    from pytest_simbench.tasks.base import Task

SAVED_COSTS = ("rtf", "cpu", "ram", "ram_peak", "cpu_cost", "start", "end", "total")


class RepeatFixture:
    """What the fixture `repeat` does, called with a task.

    Args:
        node: the test.
        case: simulator and settings.
        run: takes the records.
    """

    def __init__(self, node: pytest.Item, case: Case, run: Run) -> None:
        self.node = node
        self.case = case
        self.this = run
        self.results: list[ResultSet] = []
        self.described: dict[str, Description] = {}
        self._may_resume = False

    def __call__(self, task: Task) -> ResultSet:
        """Run a task's repetitions, as many as options and marks say."""
        experiment = Experiment(self.case, task)
        wanted = options.repetitions(self.node.config)
        fixed = wanted if isinstance(wanted, int) else None
        experiment = experiment.in_case(attempt=self.this.begin(experiment))
        found = self._recorded(experiment, fixed)
        self.this.describe(experiment.task)
        self.described[experiment.task.name] = Description.of(experiment.task)
        if isinstance(wanted, options.Auto):
            plan = Plan.up_to(wanted.limit)
            first = self._up_to(plan.looks[0], experiment, found)
            result: ResultSet = SequentialResultSet(
                first,
                experiment.metrics,
                plan,
                lambda number: self._up_to(number, experiment, found),
            )
        else:
            number = wanted or number_mark(self.node, "reps") or self.case.protocol.repetitions
            result = ResultSet(self._up_to(int(number), experiment, found), experiment.metrics)
        result.strict = options.value(self.node.config, "sim_strict")
        self.results.append(result)
        return result

    def _recorded(self, experiment: Experiment, wanted: int | None) -> dict[int, Record]:
        """By repetition what the run that is completed has of these; now of this run."""
        from pytest_simbench.plugin.resume import NotResumed

        try:
            return self.this.take(experiment, wanted)
        except NotResumed as refusal:
            pytest.fail(str(refusal), pytrace=False)

    def _up_to(self, number: int, experiment: Experiment, found: dict[int, Record]) -> list[Record]:
        """Records of all repetitions from 1 to `number`, and of what a resumed run has beyond.

        Args:
            number: of repetitions wanted.
            experiment: to repeat where one is missing; its case has the attempt.
            found: the records so far, by repetition; takes the new ones.
        """
        missing = [k for k in range(1, number + 1) if k not in found]
        if missing:
            if self.this.resumed is not None and not self._may_resume:
                self._check_versions(experiment)
            self.this.begin_lines()
            jobs = options.value(self.node.config, "sim_jobs")
            repeater = Repeater(experiment, jobs, self.this.progress, self.this.folder.append)
            found |= {r.repetition: r for r in repeater.run(missing).records}
        return [found[k] for k in sorted(found)]

    def _check_versions(self, experiment: Experiment) -> None:
        from pytest_simbench.plugin.resume import NotResumed

        assert self.this.resumed is not None
        try:
            self.this.resumed.check_versions(experiment)
        except NotResumed as refusal:
            pytest.fail(str(refusal), pytrace=False)
        self._may_resume = True

    def finish(self, benchmark: Any) -> None:
        """Tell pytest-benchmark, where there is one, and JUnit; called when the test has ended."""
        for result in self.results:
            self.node.user_properties.extend(_properties(result))
        if self.results and benchmark is not None:
            _benchmark(benchmark, self.results, self.described.values())


def _properties(result: ResultSet) -> Iterator[tuple[str, float]]:
    """For JUnit: the mean of each metric and cost and the ends of its 95 % interval."""
    yield "repetitions", len(result.ok) + len(result.failures)
    yield "failures", len(result.failures)
    for known in result.known:
        found = result.interval(known)
        name = in_one_line(known)
        if found.n:
            yield name, found.mean
            if isfinite(found.half_width):
                yield f"{name}.low", found.low
                yield f"{name}.high", found.high


def _benchmark(benchmark: Any, results: list[ResultSet], described: Iterable[Description]) -> None:
    """Hand the finished repetitions to pytest-benchmark as rounds of worker seconds.

    pytest-benchmark has one result for a test: rounds are those of its first task. The records are
    of all its tasks.
    """
    result = results[0]
    if not result.ok:
        return
    seconds = iter([record.stepping["wall"] for record in result.ok])

    def advance() -> None:
        worker_clock.seconds += next(seconds, 0.0)

    first = result.ok[0]
    benchmark.extra_info.update(
        {
            "simulator": first.simulator,
            "mode": first.mode,
            "profile": first.profile,
            "protocol": first.protocol,
            "settings": dict(first.settings),
            "versions": dict(first.versions),
            "host": dict(first.host),
            "failures": len(result.failures),
            "metrics": {name: result.values(name) for name in result.metrics},
            "seeds": [record.seed for record in result.ok],
            "costs": {name: [record.cost(name) for record in result.ok] for name in SAVED_COSTS},
            baseline.KEY: baseline.to_extra_info(
                (r for found in results for r in found.records), described
            ),
        }
    )
    benchmark.pedantic(advance, rounds=len(result.ok), iterations=1, warmup_rounds=0)
