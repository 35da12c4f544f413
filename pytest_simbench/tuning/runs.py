"""Ordinary repetitions of a search, of which the run folder may hold some already."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pytest_simbench.client.errors import Unavailable, WorkerError
from pytest_simbench.experiment.executor import Executor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repeater import ProgressLine, Repeater
from pytest_simbench.experiment.resumed import Resumed
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.record import Record
from pytest_simbench.tuning.target import TuningError


@dataclass(eq=False)
class Runs:
    """Repetitions. What the run folder holds already is not repeated.

    Attributes:
        executor, progress, folder: where, what tells of it, and where records go.
        resumed: what was left in the folder.
        spent: what of it was taken took [s].
    """

    executor: Executor
    progress: ProgressLine
    folder: RunFolder
    resumed: Resumed | None = None
    spent: float = 0.0

    @property
    def jobs(self) -> int:
        """Repetitions at once."""
        return self.executor.jobs

    def records(self, experiment: Experiment, numbers: Sequence[int]) -> dict[int, Record]:
        """Of these repetitions, by number; without those that were ended because another one ended
        all.

        Raises:
            TuningError: it cannot be run here.
        """
        if problem := experiment.problem():
            raise TuningError(problem)
        kept = self.resumed.take(experiment, None) if self.resumed else {}
        had = [kept[number].cost("total") or 0.0 for number in numbers if number in kept]
        self.spent += max(had, default=0.0)  # they were had at once
        if missing := [number for number in numbers if number not in kept]:
            self.folder.describe(experiment.task)
            before = len(self.folder.own)
            repeater = Repeater(experiment, self.executor, self.progress, self.folder.append)
            try:
                repeater.run(missing)
            except Unavailable as error:
                raise TuningError(error.what) from None
            except WorkerError:  # another world than was asked for: its record tells
                pass
            made = [r for r in self.folder.own[before:] if r.status != "interrupted"]
            kept |= {record.repetition: record for record in made}
        return {number: kept[number] for number in numbers if number in kept}
