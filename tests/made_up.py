"""Repetitions that are made up: no worker is started, so no engine is needed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pytest_simbench.experiment.executor import Executor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.identity import record_of, settings, versions
from pytest_simbench.experiment.repetition import Ended, Hooks

End = Callable[[Experiment, int], tuple[dict[str, Any], BaseException | None]]
"""What a repetition of this number ends with: fields of its record, and an error."""


@dataclass(eq=False)
class Repetition:
    experiment: Experiment
    number: int
    hooks: Hooks
    end: End

    def run(self) -> Ended:
        self.hooks.begin("")
        case = self.experiment.case
        told = {"settings": settings(case), "versions": versions(case), "seconds": {"total": 1.0}}
        found, error = self.end(self.experiment, self.number)
        return record_of(self.experiment, self.number, **{**told, **found}), error

    def kill(self) -> None:
        """Nothing runs."""


class MadeUp(Executor):
    """Takes the place of this machine's workers."""

    jobs = 1

    def __init__(self, jobs: int, end: End) -> None:
        self.jobs, self.end = jobs, end

    def repetition(
        self, experiment: Experiment, number: int, hooks: Hooks | None = None
    ) -> Repetition:
        return Repetition(experiment, number, hooks or Hooks(), self.end)
