"""The repetitions of one test: those recorded, those to run, and what pytest is told of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from math import isfinite
from typing import Any

import pytest

from pytest_simbench.cli.values import Auto
from pytest_simbench.client.errors import ExecutorError, Unavailable
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment, JitterError
from pytest_simbench.experiment.identity import describe_robot, scene_digest
from pytest_simbench.experiment.repeater import Repeater
from pytest_simbench.experiment.resumed import NotResumed
from pytest_simbench.experiment.sequential import Plan, SequentialResultSet
from pytest_simbench.ground.text import in_one_line
from pytest_simbench.measure.results import ResultSet
from pytest_simbench.measure.verdicts import Judgement
from pytest_simbench.measure.verdicts import Verdict as DataVerdict
from pytest_simbench.plugin import options, recording
from pytest_simbench.plugin.arguments import can_do, checked_task, failing, refuse
from pytest_simbench.plugin.benchmark import give_rounds
from pytest_simbench.plugin.marks import number
from pytest_simbench.plugin.run import Run
from pytest_simbench.plugin.session import session_of
from pytest_simbench.records.claims import Claim
from pytest_simbench.records.configuration import task_parameters, text
from pytest_simbench.records.description import TaskDescription, by_task
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.record import Record, RecordError, plain
from pytest_simbench.records.series import short
from pytest_simbench.scene.policy import LoopError
from pytest_simbench.tasks.base import Task

__tracebackhide__ = True  # a mistake in a task is told at its own line

REFUSALS = (NotResumed, ExecutorError, RecordError, JitterError)
"""Errors whose sentences fail the test."""


class RepeatFixture:
    """What the fixture `repeat` does for a test, called with a task; the run takes the records.

    Attributes:
        ends: outcomes of the test, and of its subtests.
    """

    def __init__(self, node: pytest.Item, case: Case, run: Run) -> None:
        self.node = node
        self.case = case
        self.run = run
        self.known: list[tuple[str, ...]] = []
        self.results: list[ResultSet] = []
        self.described: list[TaskDescription] = []
        self.ends: set[str] = set()
        self.claims: list[Claim] = []
        self.properties: list[tuple[str, object]] = []

    def __call__(self, task: Task) -> ResultSet:
        """Run a task's repetitions, as many as options and marks say.

        One of which records say the same as of an earlier one fails the test: the repetitions could
        not be told apart. The same task with other parameters is another one.
        """
        wanted = number(self.node, "sim_reps")
        skips = session_of(self.node.config).selection.every_robot
        experiment = can_do(Experiment(self.case, checked_task(task, "repeat")), skips)
        robot = describe_robot(getattr(task, "robot", None))
        known = (task.name, text([plain(task.parameters()), robot]), scene_digest(task))
        if known in self.known:
            refuse(
                f"repeat() is called for the task {task.name!r} a second time in one test with the "
                "same parameters, and its repetitions could not be told apart: write a second "
                "test, parametrize this one, or give the other task a `name` of its own"
            )
        self.known.append(known)
        experiment = experiment.in_case(attempt=self.run.begin(experiment))
        with failing(REFUSALS):
            found = self.run.take(experiment, wanted if isinstance(wanted, int) else None)
            self.run.describe(experiment.task)
        self.described.append(TaskDescription.of(experiment.task))

        run = self.run
        repeater = Repeater(
            experiment, run.executor, run.progress, run.folder.append, run.begin_lines, run.resumed
        )

        def up_to(number: int) -> list[Record]:
            try:
                with failing((*REFUSALS, LoopError)):
                    return repeater.up_to(number, found)
            except Unavailable as error:
                run.tell(f"{short(self.case.test)} was skipped: {error.what}")
                raise

        metrics = experiment.task.metrics
        auto = isinstance(wanted, Auto)
        if auto and not experiment.most:
            plan = Plan.up_to(wanted.limit)
            first = up_to(plan.looks[0])
            result: ResultSet = SequentialResultSet(first, metrics, plan, up_to)
        else:
            result = ResultSet(up_to(experiment.repetitions(None if auto else wanted)), metrics)
        recording.photograph(self.node.config, experiment, result.records, self.run.tell)
        result.strict = options.value(self.node.config, "sim_strict")
        result.warns = False
        self.results.append(result)
        return result

    def check_crashes(self) -> None:
        """Fail the test when more repetitions crashed than may: as asked, else none; at the time
        steps of a sweep a crash is a finding, and all may."""
        most = number(self.node, "sim_crashes")
        if most is None:
            most = 0.0 if self.case.own_timestep is None else 1.0
        with failing(AssertionError):
            for result in self.results:
                result.check_crashes(most)

    def finish(self, benchmark: Any) -> None:
        """Tell pytest-benchmark, where there is one, and JUnit; called when the test has ended."""
        alike = Counter[tuple[object, ...]]()
        known, properties = self.ends and "failed" not in self.ends, self.properties
        for k, result in enumerate(self.results, start=1):
            which = f"{result.records[0].task} {k}: " if len(self.results) > 1 else ""
            for name, value in _properties(result):
                properties.append((in_one_line(f"{which}{name}"), value))
            for metric, judgement in result.judged:
                claim = claim_of(self.case, result, metric, judgement)
                if known and claim.verdict == "FAIL":
                    claim = replace(claim, verdict="XFAIL")
                self.claims.append(replace(claim, number=alike[claim.identity]))
                self.run.folder.claim(self.claims[-1])
                alike[claim.identity] += 1
                title = in_one_line(f"{which}claim {metric.name} {judgement.claim}")
                properties.append((title, claim.verdict))
        self.node.user_properties += properties
        if self.results and benchmark is not None:
            give_rounds(benchmark, self.results, by_task(self.described).values())

    def take_back(self) -> None:
        """What this attempt of the test told counts no more."""
        for claim in self.claims:
            self.run.folder.claim(replace(claim, verdict=""))
        told = self.node.user_properties
        told[:] = [item for item in told if item not in self.properties]


def claim_of(case: Case, result: ResultSet, metric: Metric, judgement: Judgement) -> Claim:
    """What the run folder keeps of a claim."""
    verdict = {DataVerdict.SUPPORTED: "PASS", DataVerdict.REFUTED: "FAIL"}
    bounds = judgement.interval
    return Claim(
        test=case.test,
        function=case.function,
        variant=case.variant,
        simulator=case.simulator,
        mode=case.mode,
        profile=case.profile,
        task=result.records[0].task,
        metric=metric.name,
        relation=judgement.claim.relation,
        threshold=judgement.claim.value,
        verdict=verdict.get(judgement.verdict, "UNDECIDED"),  # type: ignore[arg-type]
        mean=bounds.mean,
        low=bounds.low,
        high=bounds.high,
        n=bounds.n,
        crashed=len(result.crashed),
        without=result.without(metric),
        advice=judgement.advice,
        parameters=task_parameters(result.records[0]),
    )


def _properties(result: ResultSet) -> Iterator[tuple[str, float]]:
    """For JUnit: the mean of each metric and cost and the ends of its 95 % interval."""
    yield "repetitions", len(result.ok) + len(result.crashed)
    yield "crashed", len(result.crashed)
    for known in result.known:
        found = result.interval(known)
        if found.n:
            yield known, found.mean
            if isfinite(found.half_width):
                yield f"{known}.low", found.low
                yield f"{known}.high", found.high
