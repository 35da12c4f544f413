"""Protocols: how a repetition is run and what is recorded around it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pytest_simbench.tasks.base import Task


@dataclass(frozen=True)
class Protocol:
    """How repetitions are run.

    Attributes:
        name: as given to `--protocol`.
        real_time: step in step with the wall clock.
        before: how long the idle worker is recorded before its simulator starts [s].
        repetitions: default of `--reps`.
        smallest: run the smallest version of each task.
        study: run each task by the reference study's own rules.
    """

    name: str
    real_time: bool = False
    before: float = 0.0
    repetitions: int = 20
    smallest: bool = False
    study: bool = False

    def version_of(self, task: Task) -> Task:
        """What is run when a test asks for `task`; `Experiment.task` asks, and nobody else."""
        if self.smallest:
            return task.smoke()
        return task.study() if self.study else task


PROTOCOLS = {
    protocol.name: protocol
    for protocol in (
        Protocol("fast"),
        Protocol("paper", real_time=True, before=5.0, study=True),
        Protocol("smoke", repetitions=1, smallest=True),
    )
}
"""The study's time-outs (900 s, 600 s) are the tasks' own and hold in every protocol."""
