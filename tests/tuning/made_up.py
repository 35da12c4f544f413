"""Repetitions whose cost and score follow from the settings, without an engine."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pytest_simbench.cli.runs import printed
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.identity import settings
from pytest_simbench.experiment.resumed import Resumed
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.record import Failure
from pytest_simbench.tuning.target import Look, Target
from pytest_simbench.tuning.trials import Runs, Trials
from tests.made_up import MadeUp
from tests.tiny import Falling

Score = Callable[[Mapping[str, Any], int], float | None]
"""By settings and repetition; None: it fails."""

LANDED = Falling().metrics[0]


class Scored(MadeUp):
    """Repetitions that cost and score what the settings say.

    Attributes:
        asked: variant and number of each.
    """

    def __init__(self, score: Score, jobs: int = 1) -> None:
        super().__init__(jobs, self._ended)
        self.score = score
        self.asked: list[tuple[str, int]] = []

    def _ended(self, experiment: Experiment, number: int) -> tuple[dict[str, Any], None]:
        found = settings(experiment.case)
        self.asked.append((experiment.case.variant, number))
        score = self.score(found, number)
        told = {"metrics": {"landed": score}, "status": "failed" if score is None else "ok"}
        error = None if score is not None else Failure("WorkerHung", "it hangs", "fall")
        stepping = {"cpu": 1e-5 / found["timestep"], "simulated": 1.0}
        return {**told, "error": error, "stepping": stepping}, None


def target(chosen: int = 4, judged: int = 6) -> Target:
    halves = [tuple(Look(Falling(), k) for k in range(1, n + 1)) for n in (chosen, judged)]
    return Target("falling", "cpu_cost", halves[0], halves[1], LANDED)


def trials(
    folder: Path, score: Score, of: Target | None = None, jobs: int = 1
) -> tuple[Trials, Scored]:
    """On MuJoCo's default settings, of 2 ms; a folder that holds a run is gone on with."""
    executor, place = Scored(score, jobs), RunFolder(folder)
    place.lock()
    resumed = Resumed(place) if place.holds_run else None
    case = Case.of("mujoco", profile="default", test="t", mode="headless", folder=folder)
    return Trials(of or target(), case, Runs(executor, printed(True), place, resumed)), executor
