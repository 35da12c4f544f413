"""Where repetitions are carried out: in workers of this machine, or elsewhere (`cluster`)."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Iterable
from contextlib import AbstractContextManager, nullcontext

from pytest_simbench.client.errors import Interrupted, Where
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.prefetch import Prefetch
from pytest_simbench.experiment.repetition import Carried, Ended, Hooks, Repetition
from pytest_simbench.experiment.slots import Slots, slot
from pytest_simbench.experiment.workers import IdleWorkers


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
    def probe(self, experiment: Experiment) -> Ended:
        """Start and end the simulator alone: the record's settings and versions are what counts."""

    def end_test(self) -> None:  # noqa: B027 (nothing to do is fine)
        """The repetitions of one test have ended."""

    def close(self) -> None:  # noqa: B027
        """The run has ended."""


class LocalExecutor(Executor):
    """Workers of this machine, never more at once than there are slots. Several side by side mark
    their records contended.

    Args:
        jobs: number of the slots.
        expected: of these the first repetition will be asked for, in this order, see `Prefetch`.
        slots: address of the slots where several processes share them; empty: this one has its own.
    """

    jobs: int = 1

    def __init__(
        self, jobs: int = 1, *, expected: Iterable[Experiment] = (), slots: str = ""
    ) -> None:
        self.jobs = jobs
        self._idle = IdleWorkers()
        self._shared = False
        self._own = Slots(jobs) if jobs > 1 and not slots else None
        self._slots = self._own.address if self._own else slots
        self._prefetch = Prefetch(jobs - 1, expected, self._ahead)

    def repetition(
        self, experiment: Experiment, number: int, hooks: Hooks | None = None
    ) -> Carried:
        hooks = hooks or Hooks()
        if begun := self._prefetch.take(experiment, number, hooks):
            return begun
        self._shared = experiment.task.shares_worker
        return _Queued(self._slots, self._here(experiment), number, hooks, self._idle)

    def _here(self, experiment: Experiment) -> Experiment:
        return experiment.in_case(contended=True) if self.jobs > 1 else experiment

    def _ahead(self, experiment: Experiment, idle: IdleWorkers) -> Carried:
        """A first repetition before its test: it takes a slot that nobody else waits for."""
        return _Queued(self._slots, self._here(experiment), 1, Hooks(), idle, later=True)

    def probe(self, experiment: Experiment) -> Ended:
        return Repetition(experiment, 0).probe()

    def end_test(self) -> None:
        if not self._shared:
            self._idle.close()

    def close(self) -> None:
        self._prefetch.close()
        self._idle.close()
        if self._own is not None:
            self._own.close()


class _Queued:
    """A repetition that begins when it has a slot."""

    def __init__(
        self,
        slots: str,
        experiment: Experiment,
        number: int,
        hooks: Hooks,
        idle: IdleWorkers,
        *,
        later: bool = False,
    ) -> None:
        self._slots, self._later = slots, later
        self._experiment, self._number = experiment, number
        self._hooks, self._idle = hooks, idle
        self._stop = threading.Event()
        self._repetition: Repetition | None = None

    def kill(self) -> None:
        self._stop.set()
        if self._repetition is not None:
            self._repetition.kill()

    def run(self) -> Ended:
        experiment, number, case = self._experiment, self._number, self._experiment.case
        with self._slot() as granted:
            if not granted:
                where = Where(case.simulator, case.mode, number, experiment.seed(number))
                raise Interrupted("the run was interrupted", where)
            self._hooks.begin("")
            repetition = Repetition(experiment, number, idle=self._idle, hooks=self._hooks)
            self._repetition = repetition
            if self._stop.is_set():  # just before there was something to kill
                repetition.kill()
            return repetition.run()

    def _slot(self) -> AbstractContextManager[bool]:
        if not self._slots:
            return nullcontext(True)
        test = f"{self._experiment.case.test} {self._experiment.task.name}"
        return slot(self._slots, test, self._stop.is_set, later=self._later)
