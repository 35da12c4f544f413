"""Repetitions that begin before their test does.

pytest runs its tests in order, so tests of one repetition each would leave all but one of
`--sim-jobs` idle. Where it is known what tests will ask for, free slots carry it out meanwhile.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from concurrent.futures import Future

from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.interrupts import Interrupts
from pytest_simbench.experiment.repetition import Carried, Ended, Hooks
from pytest_simbench.experiment.workers import IdleWorkers

Make = Callable[[Experiment, IdleWorkers], Carried]
"""Gives the first repetition of an experiment; it may take one of the workers."""


class Prefetch:
    """Threads that carry out what later tests will ask for. Each of them takes all tests of one
    simulator, the last simulator first, until the tests have come to those that are left.

    Args:
        threads: so many.
        expected: of these the first repetition will be asked for, in this order.
        make: gives each.
    """

    def __init__(
        self,
        threads: int,
        expected: Iterable[Experiment],
        make: Make,
    ) -> None:
        self._make = make
        self._lock = threading.Lock()
        self._groups: dict[tuple[object, ...], list[Experiment]] = {}
        for experiment in expected:
            self._groups.setdefault(_worker(experiment), []).append(experiment)
        self._begun: list[_Begun] = []
        self._threads: list[threading.Thread] = []
        if self._groups:
            self._threads = [
                threading.Thread(target=self._work, name=f"simbench-prefetch-{k}")
                for k in range(threads)
            ]
        self._started = False

    def take(self, experiment: Experiment, number: int, hooks: Hooks) -> Carried | None:
        """What a test has come to, if it was begun before; with the first test the threads begin.

        Args:
            experiment, number: that the test asks for.
            hooks: are told that it begins; of the rest nothing is told.
        """
        with self._lock:
            self._groups.pop(_worker(experiment), None)
            found = [begun for begun in self._begun if begun.experiment == experiment]
            if number == 1 and found:
                self._begun.remove(found[0])
            first, self._started = not self._started, True
        for thread in self._threads if first else ():
            thread.start()
        if number != 1 or not found:
            return None
        hooks.begin("")
        found[0].interrupts = hooks.interrupts
        return found[0]

    def _work(self) -> None:
        while group := self._next_group():
            idle = IdleWorkers()
            for begun in group:
                begun.carry_out(self._make, idle)
            idle.close()

    def _next_group(self) -> list[_Begun]:
        with self._lock:
            if not self._groups:
                return []
            _, experiments = self._groups.popitem()
            group = [_Begun(experiment) for experiment in experiments]
            self._begun += group
            return group

    def close(self) -> None:
        """End what no test has come to."""
        with self._lock:
            self._groups.clear()
            left = list(self._begun)
        for begun in left:
            begun.kill()
        for thread in self._threads if self._started else ():
            thread.join()


class _Begun:
    """The first repetition of an experiment, which another thread carries out.

    Attributes:
        interrupts: of the test that has come to it.
    """

    def __init__(self, experiment: Experiment) -> None:
        self.experiment = experiment
        self.interrupts = Interrupts()
        self._ended: Future[Ended] = Future()
        self._repetition: Carried | None = None

    def carry_out(self, make: Make, idle: IdleWorkers) -> None:
        try:
            self._repetition = make(self.experiment, idle)
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
