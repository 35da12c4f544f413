"""Where repetitions are carried out: in workers of this machine, or elsewhere (`cluster`).

pytest runs its tests in order, so tests of one repetition each would leave all but one of
`--sim-jobs` idle. Where it is known what tests will ask for, free slots carry it out meanwhile.
"""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial

from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.interrupts import Interrupts
from pytest_simbench.experiment.repetition import AnyRepetition, Ended, Hooks, Repetition
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

    @property
    def slots(self) -> int:
        """How many of these do not wait for another one's end."""
        return self.jobs

    @abstractmethod
    def repetition(
        self, experiment: Experiment, number: int, hooks: Hooks | None = None
    ) -> AnyRepetition:
        """A repetition that has not begun.

        Args:
            number: of the repetition, from 1; 0 starts and ends the simulator alone, so that
                the record tells its settings and versions.
        """

    def end_test(self) -> None:  # noqa: B027 (nothing to do is fine)
        """The repetitions of one test have ended."""

    def close(self) -> None:  # noqa: B027
        """The run has ended."""


class LocalExecutor(Executor):
    """Workers of this machine, never more at once than there are slots. Several side by side mark
    their records contended.

    Other threads carry out what later tests will ask for. Each of them takes all tests of one
    simulator, the last simulator first, until the tests have come to those that are left.

    Args:
        jobs: number of the slots.
        expected: of these the first repetition will be asked for, in this order.
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
        self._later: dict[object, list[_Begun]] = {}
        for experiment in expected if jobs > 1 else ():
            self._later.setdefault(_worker(experiment), []).append(_Begun(experiment))
        self._lock = threading.Lock()
        self._pool = ThreadPoolExecutor(max(1, jobs - 1), thread_name_prefix="simbench-prefetch")
        self._under_way: dict[object, Future[None]] = {}

    def repetition(
        self, experiment: Experiment, number: int, hooks: Hooks | None = None
    ) -> AnyRepetition:
        hooks = hooks or Hooks()
        if begun := self._prefetched(experiment, number):
            hooks.begin("")  # of the rest nothing is told
            begun.interrupts = hooks.interrupts
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

    def _prefetched(self, experiment: Experiment, number: int) -> _Begun | None:
        """What a test has come to, if it was begun; with the first test the threads begin."""
        worker = _worker(experiment)
        with self._lock:
            if worker not in self._under_way or self._under_way[worker].cancel():
                self._later.pop(worker, None)
            if not self._under_way:
                for other, group in reversed(self._later.items()):
                    self._under_way[other] = self._pool.submit(self._carry_out, tuple(group))
            found = [b for b in self._later.get(worker, ()) if b.experiment == experiment]
            if number != 1 or not found:
                return None
            self._later[worker].remove(found[0])
            return found[0]

    def _carry_out(self, group: Iterable[_Begun]) -> None:
        idle = IdleWorkers()
        for begun in group:
            begun.carry_out(partial(self._queued, begun.experiment, 1, idle))
        idle.close()

    def end_test(self) -> None:
        if not self._shared:
            self._idle.close()

    def close(self) -> None:
        for future in self._under_way.values():
            future.cancel()
        for begun in [begun for group in self._later.values() for begun in group]:
            begun.kill()
        self._pool.shutdown()
        self._idle.close()
        if self._own is not None:
            self._own.close()


class _Begun:
    """The first repetition of an experiment, which another thread carries out.

    Attributes:
        interrupts: of the test that has come to it.
    """

    def __init__(self, experiment: Experiment) -> None:
        self.experiment = experiment
        self.interrupts = Interrupts()
        self._ended: Future[Ended] = Future()
        self._repetition: AnyRepetition | None = None

    def carry_out(self, make: Callable[[], AnyRepetition]) -> None:
        try:
            self._repetition = make()
            if self._ended.set_running_or_notify_cancel():
                self._ended.set_result(self._repetition.run())
        except BaseException as error:
            self._ended.set_exception(error)

    def run(self) -> Ended:
        try:
            found = self._ended.result()
            self.interrupts.hold()
            return found
        except BaseException as raised:
            self.interrupts.hold()
            self.kill()
            if self._ended.cancelled():
                raise
            return self._ended.result()[0], raised

    def kill(self) -> None:
        if not self._ended.cancel() and self._repetition is not None:
            self._repetition.kill()


def _worker(experiment: Experiment) -> tuple[object, ...]:
    """What experiments that one worker can serve have in common."""
    case = experiment.case
    return case.simulator, case.mode, case.profile, case.python, case.spec
