"""Ordinary repetitions of a search, of which the run folder may hold some already."""

from __future__ import annotations

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
    """Repetitions, one after the other. What the run folder holds already is not repeated.

    Attributes:
        executor, progress, folder: where, what tells of it, and where records go.
        resumed: what was left in the folder.
    """

    executor: Executor
    progress: ProgressLine
    folder: RunFolder
    resumed: Resumed | None = None

    def record(self, experiment: Experiment, number: int = 1) -> Record:
        """Of that repetition.

        Raises:
            TuningError: it cannot be run here.
        """
        if problem := experiment.problem():
            raise TuningError(problem)
        kept = self.resumed.take(experiment, None) if self.resumed else {}
        if number in kept:
            return kept[number]
        self.folder.describe(experiment.task)
        repeater = Repeater(experiment, self.executor, self.progress, self.folder.append)
        try:
            return repeater.run([number]).records[0]
        except Unavailable as error:
            raise TuningError(error.what) from None
        except WorkerError:  # another world than was asked for: its record tells
            return self.folder.own[-1]
