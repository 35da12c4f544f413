"""Where repetitions are carried out: in workers of this machine, or elsewhere (`cluster`)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from functools import partial

from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.prefetch import Prefetch
from pytest_simbench.experiment.repetition import AnyRepetition, Hooks, Repetition
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
    ) -> AnyRepetition:
        """A repetition that has not begun.

        Args:
            experiment: that is repeated.
            number: of the repetition, from 1; 0 starts and ends the simulator alone, so that
                the record tells its settings and versions.
            hooks: what is told of it.
        """

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
        self._prefetch = Prefetch(jobs - 1, expected if jobs > 1 else (), self._queued)

    def repetition(
        self, experiment: Experiment, number: int, hooks: Hooks | None = None
    ) -> AnyRepetition:
        hooks = hooks or Hooks()
        if begun := self._prefetch.take(experiment, number, hooks):
            return begun
        self._shared = experiment.task.shares_worker
        return self._queued(experiment, number, self._idle, hooks)

    def _queued(
        self, experiment: Experiment, number: int, idle: IdleWorkers, hooks: Hooks | None = None
    ) -> Repetition:
        """A repetition that waits for a slot; without hooks, until no test waits for one."""
        test = f"{experiment.case.test} {experiment.task.name}"
        wait = partial(slot, self._slots, test, later=hooks is None) if self._slots else None
        if self.jobs > 1:
            experiment = experiment.in_case(contended=True)
        return Repetition(experiment, number, idle=idle, hooks=hooks, slot=wait)

    def end_test(self) -> None:
        if not self._shared:
            self._idle.close()

    def close(self) -> None:
        self._prefetch.close()
        self._idle.close()
        if self._own is not None:
            self._own.close()
