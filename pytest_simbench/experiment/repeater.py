"""All repetitions of an experiment, one after the other or side by side."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from typing import Protocol as Interface

from pytest_simbench.client.errors import SceneRefused, Unavailable, WorkerError, WorldParityError
from pytest_simbench.experiment.executor import Executor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.interrupts import Interrupts
from pytest_simbench.experiment.repetition import AnyRepetition, Ended, Hooks
from pytest_simbench.experiment.resumed import Resumed
from pytest_simbench.measure.results import ResultSet
from pytest_simbench.records.record import Record
from pytest_simbench.records.series import short
from pytest_simbench.scene import SceneError
from pytest_simbench.tasks.recorded import code_of

__tracebackhide__ = True  # a mistake in a task is told at its own line


class ProgressLine(Interface):
    """What the live line is told; `report.progress.Progress` is one."""

    def start_test(self, test_id: str, repetitions: int, last: int | None = None) -> None: ...
    def repetition(self, number: int, seed: int, node: str = "") -> None: ...
    def phase(self, name: str) -> None: ...
    def count(self, done: int, total: int, noun: str = "") -> None: ...
    def end_repetition(self, status: str, seconds: float) -> None: ...
    def end_test(self) -> None: ...


@dataclass(eq=False)
class Repeater:
    """Runs repetitions of an experiment and hands each record over as it is made.

    Attributes:
        executor: where and how many side by side.
        keep: takes every record at once, before anything else can go wrong.
        begin: is called before the first progress.
        resumed: the interrupted run that is completed, if one is.
        records_refusals: whether a scene that is refused or cannot be, or a policy that cannot be
            asked, is a repetition that failed, as it is at another time step; the first also after
            a repetition of the same test that was not refused.
    """

    experiment: Experiment
    executor: Executor
    progress: ProgressLine
    keep: Callable[[Record], None]
    begin: Callable[[], None] = lambda: None
    resumed: Resumed | None = None
    records_refusals: bool = False
    _recorded: bool = field(default=False, init=False)
    _ended_early: bool = field(default=False, init=False)
    _active: set[AnyRepetition] = field(default_factory=set, init=False)
    _stopping: threading.Event = field(default_factory=threading.Event, init=False)

    def up_to(self, number: int, found: dict[int, Record]) -> list[Record]:
        """Records of all repetitions from 1 to `number`, and of what a resumed run has beyond;
        `found` holds those so far, by repetition, and takes the new ones. Raises as `run`, and
        `NotResumed` where the versions are not those of the run, `JitterError`."""
        missing = [k for k in range(1, number + 1) if k not in found]
        self.experiment.check_jitter(missing)
        if missing:
            self._recorded = bool(found)
            code_of(self.experiment.task)  # as it is before it acts
            if self.resumed is not None:
                self.resumed.check_versions(self.experiment, self.executor)
            self.begin()
            found |= {r.repetition: r for r in self.run(missing).records}
        return [found[k] for k in sorted(found)]

    def run(self, numbers: Iterable[int]) -> ResultSet:
        """Run the repetitions of these numbers.

        Raises:
            Unavailable: the machine lacks what it takes, in this mode at least, or the scene of the
                first repetition is refused.
            SceneError: a scene cannot be, or a policy cannot be asked as it shall be.
            WorldParityError: the engine builds another world; more repetitions would not help.
            KeyboardInterrupt: after the records of what was running are kept.
        """
        numbers = list(numbers)
        name = short(self.experiment.case.test)
        self.progress.start_test(name, len(numbers), max(numbers, default=0))
        try:
            if self.executor.jobs > 1 and len(numbers) > 1:
                records = self._side_by_side(numbers)
            else:
                records = [self._one(number) for number in numbers]
        finally:
            self.executor.end_test()
            self.progress.end_test()
        return ResultSet(records, self.experiment.task.metrics)

    def _one(self, number: int) -> Record:
        with Interrupts() as interrupts:
            record, error = self._kept(number, interrupts)
        if error is not None and self._ends_all(error):
            raise error
        return record

    def _ends_all(self, error: BaseException) -> bool:
        """Whether no repetition is tried after this error. At a time step that is not the profile's
        own, what a simulator cannot do is a finding, and its record tells it."""
        if self.experiment.case.own_timestep is not None and isinstance(error, Exception):
            return False
        return isinstance(error, WorldParityError) or not isinstance(error, WorkerError)

    def _kept(self, number: int, interrupts: Interrupts) -> Ended:
        """Run one repetition and keep its record."""
        progress, experiment = self.progress, self.experiment
        begun = False

        def begin(node: str) -> None:
            nonlocal begun
            begun = True
            progress.repetition(number, experiment.seed(number), node)

        hooks = Hooks(
            begin=begin,
            phase=progress.phase,
            count=lambda done, total: progress.count(done, total, experiment.task.counted),
            interrupts=interrupts,
        )
        repetition = self.executor.repetition(experiment, number, hooks)
        self._active.add(repetition)
        if self._stopping.is_set():  # this thread took it up just before it could be cancelled
            repetition.kill()
        record, error = repetition.run()
        self._active.discard(repetition)
        found = self.records_refusals or experiment.case.own_timestep
        told = isinstance(error, SceneRefused) and (self._recorded or found)
        told = told or (isinstance(error, SceneError) and found)
        if isinstance(error, Unavailable | SceneError) and not told:  # no fault of the simulator
            self._ended_early = True
            raise error
        if error is not None and record.status == "interrupted":
            if self._ended_early or not begun:
                raise error  # it was ended with one that is not recorded, or waited for a node
        else:
            self._recorded = True
        self.keep(record)
        progress.end_repetition(record.status, record.seconds["total"])
        return record, error

    def _side_by_side(self, numbers: list[int]) -> list[Record]:
        with (
            Interrupts() as interrupts,
            ThreadPoolExecutor(self.executor.jobs, thread_name_prefix="simbench") as pool,
        ):
            # Not wait(): it looks at all that are left, each time that one has ended.
            ended: SimpleQueue[Future[Record]] = SimpleQueue()
            futures = [pool.submit(self._one, k) for k in numbers]
            done: list[Record] = []
            try:
                for future in futures:
                    future.add_done_callback(ended.put)
                while len(done) < len(futures):
                    try:
                        future = ended.get(timeout=0.5)
                    except Empty:  # a signal is handled between two looks at the latest
                        continue
                    done.append(future.result())
                interrupts.hold()
            except BaseException:
                interrupts.hold()
                self._stopping.set()
                for future in futures:
                    future.cancel()
                for repetition in list(self._active):
                    repetition.kill()
                raise
        return sorted(done, key=lambda record: record.repetition)
