"""Where repetitions are carried out: in workers of this machine, or elsewhere."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Protocol as Interface

from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Hooks, Repetition
from pytest_simbench.experiment.workers import IdleWorkers
from pytest_simbench.records.record import Record


class ExecutorError(Exception):
    """Nothing can be carried out any more: a cluster is gone, for instance. One sentence."""


class Carried(Interface):
    """One repetition, carried out wherever; `repetition.Repetition` is one."""

    def run(self) -> tuple[Record, BaseException | None]:
        """Carry it out; the record, and what ended it early if anything did."""

    def kill(self) -> None:
        """End it at once, from any thread; `run` then returns an interrupted record."""


class Executor(ABC):
    """Where repetitions are carried out, and how many at once.

    The repeater calls `repetition` in as many threads as `jobs` says. All else of a test (records,
    progress, Ctrl-C, what ends it early) is the same wherever its repetitions run.
    """

    @property
    @abstractmethod
    def jobs(self) -> int:
        """Repetitions side by side, at most."""

    @abstractmethod
    def repetition(
        self, experiment: Experiment, number: int, hooks: Hooks | None = None
    ) -> Carried:
        """A repetition that has not begun.

        Args:
            experiment: that is repeated.
            number: of the repetition, from 1.
            hooks: what is told of it.
        """

    @abstractmethod
    def probe(self, experiment: Experiment) -> tuple[Record, BaseException | None]:
        """Start and end the simulator alone: the record's settings and versions are what counts."""

    def end_test(self) -> None:  # noqa: B027 (nothing to do is fine)
        """The repetitions of one test have ended."""

    def close(self) -> None:  # noqa: B027
        """The run has ended."""


class LocalExecutor(Executor):
    """Workers of this machine. Several side by side mark their records contended.

    Args:
        jobs: workers side by side.
    """

    jobs: int = 1

    def __init__(self, jobs: int = 1) -> None:
        self.jobs = jobs
        self._idle = IdleWorkers()
        self._shared = False

    def repetition(
        self, experiment: Experiment, number: int, hooks: Hooks | None = None
    ) -> Carried:
        hooks = hooks or Hooks()
        hooks.begin("")
        self._shared = experiment.task.shares_worker
        experiment = experiment.in_case(contended=True) if self.jobs > 1 else experiment
        return Repetition(experiment, number, idle=self._idle, hooks=hooks)

    def probe(self, experiment: Experiment) -> tuple[Record, BaseException | None]:
        return Repetition(experiment, 0).probe()

    def end_test(self) -> None:
        if not self._shared:
            self._idle.close()

    def close(self) -> None:
        self._idle.close()
