"""Repetitions whose cost and score follow from the settings, without an engine."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pytest_simbench.cli.runs import printed
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.executor import Executor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.identity import record_of, settings, versions
from pytest_simbench.experiment.repetition import Ended, Hooks
from pytest_simbench.experiment.resumed import Resumed
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.record import Failure
from pytest_simbench.tuning.target import Look, Target
from pytest_simbench.tuning.trials import Runs, Trials
from tests.tiny import Falling

Score = Callable[[Mapping[str, Any], int], float | None]
"""By settings and repetition; None: it fails."""

LANDED = Falling().metrics[0]


@dataclass(eq=False)
class Repetition:
    executor: MadeUp
    experiment: Experiment
    number: int
    hooks: Hooks

    def run(self) -> Ended:
        self.hooks.begin("")
        found = settings(self.experiment.case)
        self.executor.asked.append((self.experiment.case.variant, self.number))
        score = self.executor.score(found, self.number)
        record = record_of(
            self.experiment,
            self.number,
            status="failed" if score is None else "ok",
            settings=found,
            versions=versions(self.experiment.case),
            error=None if score is not None else Failure("WorkerHung", "it hangs", "fall"),
            metrics={"landed": score},
            seconds={"total": 1.0},
            stepping={"cpu": 1e-5 / found["timestep"], "simulated": 1.0},
        )
        return record, None

    def kill(self) -> None:
        """Nothing runs."""


class MadeUp(Executor):
    jobs = 1

    def __init__(self, score: Score, jobs: int = 1) -> None:
        self.score, self.jobs = score, jobs
        self.asked: list[tuple[str, int]] = []

    def repetition(
        self, experiment: Experiment, number: int, hooks: Hooks | None = None
    ) -> Repetition:
        return Repetition(self, experiment, number, hooks or Hooks())


def target(chosen: int = 4, judged: int = 6) -> Target:
    halves = [tuple(Look(Falling(), k) for k in range(1, n + 1)) for n in (chosen, judged)]
    return Target("falling", "cpu_cost", halves[0], halves[1], LANDED)


def trials(
    folder: Path, score: Score, of: Target | None = None, jobs: int = 1
) -> tuple[Trials, MadeUp]:
    """On MuJoCo's default settings, of 2 ms; a folder that holds a run is gone on with."""
    executor, place = MadeUp(score, jobs), RunFolder(folder)
    place.lock()
    resumed = Resumed(place) if place.holds_run else None
    case = Case.of("mujoco", profile="default", test="t", mode="headless", folder=folder)
    return Trials(of or target(), case, Runs(executor, printed(True), place, resumed)), executor
