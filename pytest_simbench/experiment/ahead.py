"""Repetitions that begin before their test does.

pytest runs its tests in order, so tests of one repetition each would leave all but one of
`--sim-jobs` idle. Where it is known what tests will ask for, more workers carry it out meanwhile.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable
from concurrent.futures import Future

from pytest_simbench.experiment.executor import Carried, Executor, LocalExecutor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.interrupts import Interrupts
from pytest_simbench.experiment.repetition import Hooks
from pytest_simbench.records.record import Record

Ended = tuple[Record, BaseException | None]


class AheadExecutor(Executor):
    """Workers of this machine. One serves the test that runs, and the others what later tests will
    ask for. Each of these takes all tests of one simulator, the last simulator first, until the
    tests have come to those that are left.

    Args:
        jobs: workers side by side, 2 at least.
        expected: of these the first repetition will be asked for, in this order.
    """

    def __init__(self, jobs: int, expected: Iterable[Experiment]) -> None:
        self._here = LocalExecutor(jobs)
        self._lock = threading.Lock()
        self._groups: dict[tuple[object, ...], list[Experiment]] = {}
        for experiment in expected:
            self._groups.setdefault(_worker(experiment), []).append(experiment)
        self._begun: list[_Begun] = []
        self._closing = False
        self._threads = [
            threading.Thread(target=self._work, name=f"simbench-ahead-{k}") for k in range(1, jobs)
        ]
        self._started = False

    @property
    def jobs(self) -> int:
        return self._here.jobs

    def repetition(
        self, experiment: Experiment, number: int, hooks: Hooks | None = None
    ) -> Carried:
        with self._lock:
            self._groups.pop(_worker(experiment), None)  # the tests have come to it
            found = [begun for begun in self._begun if begun.experiment == experiment]
            if number == 1 and found:
                self._begun.remove(found[0])
        self._start()
        if number != 1 or not found:
            return self._here.repetition(experiment, number, hooks)
        hooks = hooks or Hooks()
        hooks.begin("")
        found[0].interrupts = hooks.interrupts
        return found[0]

    def _start(self) -> None:
        """Begin, with the first repetition that is asked for."""
        if not self._started:
            self._started = True
            for thread in self._threads:
                thread.start()

    def _work(self) -> None:
        executor = LocalExecutor(self.jobs)
        try:
            while group := self._next_group():
                for begun in group:
                    begun.carry_out(executor)
        finally:
            executor.close()

    def _next_group(self) -> list[_Begun]:
        with self._lock:
            if self._closing or not self._groups:
                return []
            _, experiments = self._groups.popitem()
            group = [_Begun(experiment) for experiment in experiments]
            self._begun += group
            return group

    def probe(self, experiment: Experiment) -> Ended:
        return self._here.probe(experiment)

    def end_test(self) -> None:
        self._here.end_test()

    def close(self) -> None:
        with self._lock:
            self._closing = True
            left = list(self._begun)
        for begun in left:
            begun.kill()
        if self._started:
            for thread in self._threads:
                thread.join()
        self._here.close()


class _Begun:
    """The first repetition of an experiment, which another thread carries out.

    Attributes:
        interrupts: of the test that has come to it.
    """

    def __init__(self, experiment: Experiment) -> None:
        self.experiment = experiment
        self.interrupts = Interrupts()
        self._ended: Future[Ended] = Future()
        self._lock = threading.Lock()
        self._repetition: Carried | None = None

    def carry_out(self, executor: LocalExecutor) -> None:
        try:
            with self._lock:
                if self._ended.cancelled():
                    return
                self._repetition = executor.repetition(self.experiment, 1)
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
        with self._lock:
            if self._repetition is None:
                self._ended.cancel()
            else:
                self._repetition.kill()


def _worker(experiment: Experiment) -> tuple[object, ...]:
    """What experiments that one worker can serve have in common."""
    case = experiment.case
    return case.simulator, case.mode, case.profile, case.python, case.spec
