"""Repetitions that are made up: no worker is started, so no engine is needed."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

from pytest_simbench.client.errors import Unavailable, Where, WorkerExited
from pytest_simbench.experiment.executor import Executor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.identity import record_of, settings, versions
from pytest_simbench.experiment.repetition import Ended, Hooks
from pytest_simbench.records.record import Failure, Status

FAULTS: dict[str, type[BaseException]] = {}
"""What the second repetition on a simulator ends with; tests fill it."""


@dataclass(eq=False)
class Repetition:
    experiment: Experiment
    number: int
    hooks: Hooks = field(default_factory=Hooks)

    def run(self) -> Ended:
        self.hooks.begin("")
        case, error = self.experiment.case, None
        if self.number == 2 and case.simulator in FAULTS:
            kind = FAULTS[case.simulator]
            where = Where(case.simulator, case.mode)
            ours = kind in (Unavailable, WorkerExited)
            error = kind("no such luck", where) if ours else kind("no such luck")
        stopped = isinstance(error, KeyboardInterrupt)
        status: Status = "ok" if error is None else "interrupted" if stopped else "failed"
        record = record_of(
            self.experiment,
            self.number,
            status=status,
            settings=settings(case),
            versions=versions(case),
            metrics={"landed": 0.5},
            seconds={"total": 1.0},
            error=None if error is None else Failure(type(error).__name__, "no such luck", "fall"),
        )
        return record, error

    def kill(self) -> None:
        """Nothing runs."""


class Scripted(Executor):
    """Takes the place of this machine's workers.

    Attributes:
        made: those that are not closed yet.
    """

    jobs = 1
    made: ClassVar[list[Scripted]] = []

    def __init__(self, jobs: int) -> None:
        self.jobs = jobs
        self.made.append(self)

    def repetition(
        self, experiment: Experiment, number: int, hooks: Hooks | None = None
    ) -> Repetition:
        return Repetition(experiment, number, hooks or Hooks())

    def close(self) -> None:
        self.made.remove(self)
