"""The executor of one of several processes that share a machine's slots (`slots`)."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial

from pytest_simbench.client.errors import Interrupted, Where
from pytest_simbench.experiment.executor import Carried, LocalExecutor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Hooks
from pytest_simbench.experiment.slots import slot
from pytest_simbench.records.record import Record


class SharingExecutor(LocalExecutor):
    """Workers of this machine, as many at once as the slots of the whole run.

    Args:
        jobs: number of the slots.
        address: of the slots.
    """

    def __init__(self, jobs: int, address: str) -> None:
        super().__init__(jobs)
        self._address = address

    def repetition(
        self, experiment: Experiment, number: int, hooks: Hooks | None = None
    ) -> Carried:
        make = partial(super().repetition, experiment, number, hooks)
        return _Waiting(self._address, experiment, number, make)


class _Waiting:
    """A repetition that begins when it has a slot."""

    def __init__(
        self, address: str, experiment: Experiment, number: int, make: Callable[[], Carried]
    ) -> None:
        self._address = address
        self._case = experiment.case
        self._where = Where(self._case.simulator, self._case.mode, number, experiment.seed(number))
        self._test = f"{self._case.test} {experiment.task.name}"
        self._make = make
        self._stop = threading.Event()
        self._repetition: Carried | None = None

    def kill(self) -> None:
        self._stop.set()
        if self._repetition is not None:
            self._repetition.kill()

    def run(self) -> tuple[Record, BaseException | None]:
        with slot(self._address, self._test, self._stop.is_set) as granted:
            if not granted:
                raise Interrupted("the run was interrupted", self._where)
            self._repetition = self._make()
            if self._stop.is_set():
                self._repetition.kill()
            return self._repetition.run()
