"""Repetitions that begin before their test does.

pytest runs its tests in order, so tests of one repetition each would leave all but one of
`--sim-jobs` idle. Where it is known what tests will ask for, free slots carry it out meanwhile.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor

from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.interrupts import Interrupts
from pytest_simbench.experiment.repetition import AnyRepetition, Ended, Hooks
from pytest_simbench.experiment.workers import IdleWorkers

Make = Callable[[Experiment, int, IdleWorkers], AnyRepetition]
"""Gives a repetition of an experiment, by its number; it may take one of the workers."""


class Prefetch:
    """Threads that carry out what later tests will ask for. Each of them takes all tests of one
    simulator, the last simulator first, until the tests have come to those that are left.

    Args:
        threads: so many.
        expected: of these the first repetition will be asked for, in this order.
        make: gives each.
    """

    def __init__(self, threads: int, expected: Iterable[Experiment], make: Make) -> None:
        self._make = make
        self._groups: dict[object, list[_Begun]] = {}
        for experiment in expected:
            self._groups.setdefault(_worker(experiment), []).append(_Begun(experiment))
        self._lock = threading.Lock()
        self._pool = ThreadPoolExecutor(max(1, threads), thread_name_prefix="simbench-prefetch")
        self._under_way: dict[object, Future[None]] = {}

    def take(self, experiment: Experiment, number: int, hooks: Hooks) -> AnyRepetition | None:
        """What a test has come to, if it was begun before; with the first test the threads begin.

        Args:
            experiment, number: that the test asks for.
            hooks: are told that it begins; of the rest nothing is told.
        """
        worker = _worker(experiment)
        with self._lock:
            if worker not in self._under_way or self._under_way[worker].cancel():
                self._groups.pop(worker, None)
            if not self._under_way:
                for other, group in reversed(self._groups.items()):
                    self._under_way[other] = self._pool.submit(self._carry_out, group)
            found = [b for b in self._groups.get(worker, ()) if b.experiment == experiment]
            if number != 1 or not found:
                return None
            self._groups[worker].remove(found[0])
        hooks.begin("")
        found[0].interrupts = hooks.interrupts
        return found[0]

    def _carry_out(self, group: Iterable[_Begun]) -> None:
        idle = IdleWorkers()
        for begun in tuple(group):
            begun.carry_out(self._make, idle)
        idle.close()

    def close(self) -> None:
        """End what no test has come to."""
        for future in self._under_way.values():
            future.cancel()
        for begun in [begun for group in self._groups.values() for begun in group]:
            begun.kill()
        self._pool.shutdown()


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

    def carry_out(self, make: Make, idle: IdleWorkers) -> None:
        try:
            self._repetition = make(self.experiment, 1, idle)
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
