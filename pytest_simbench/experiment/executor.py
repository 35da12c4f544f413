"""Where repetitions are carried out: in workers of this machine, or elsewhere."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol as Interface

from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.interrupts import Interrupts
from pytest_simbench.experiment.repetition import Repetition
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


@dataclass(frozen=True)
class Hooks:
    """What is told of a repetition, from the thread that runs it.

    Attributes:
        begin: it begins, on the node of that name; empty for this machine.
        phase, count: progress, see `tasks.base`.
    """

    begin: Callable[[str], None] = lambda node: None
    phase: Callable[[str], None] = lambda name: None
    count: Callable[[int, int], None] = lambda done, total: None


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
        self,
        experiment: Experiment,
        number: int,
        hooks: Hooks | None = None,
        interrupts: Interrupts | None = None,
    ) -> Carried:
        """A repetition that has not begun.

        Args:
            experiment: that is repeated.
            number: of the repetition, from 1.
            hooks: progress.
            interrupts: held from the moment that it has ended, so that its record can be kept.
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

    def __init__(self, jobs: int = 1) -> None:
        self._jobs = jobs
        self._idle = IdleWorkers()
        self._shared = False

    @property
    def jobs(self) -> int:
        return self._jobs

    def repetition(
        self,
        experiment: Experiment,
        number: int,
        hooks: Hooks | None = None,
        interrupts: Interrupts | None = None,
    ) -> Repetition:
        hooks = hooks or Hooks()
        hooks.begin("")
        self._shared = experiment.task.shares_worker
        return Repetition(
            experiment.in_case(contended=True) if self.jobs > 1 else experiment,
            number,
            idle=self._idle,
            interrupts=interrupts,
            on_phase=hooks.phase,
            on_count=hooks.count,
        )

    def probe(self, experiment: Experiment) -> tuple[Record, BaseException | None]:
        return Repetition(experiment, 0).probe()

    def end_test(self) -> None:
        if not self._shared:
            self._idle.close()

    def close(self) -> None:
        self._idle.close()
