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
        doc: one sentence for the help.
    """

    name: str
    real_time: bool = False
    before: float = 0.0
    repetitions: int = 20
    smallest: bool = False
    study: bool = False
    doc: str = ""

    def version_of(self, task: Task) -> Task:
        """What is run when a test asks for `task`. Resolved once, where the test's task arrives;
        everything behind that gets the version itself."""
        if self.smallest:
            return task.smoke()
        return task.study() if self.study else task


PROTOCOLS = {
    protocol.name: protocol
    for protocol in (
        Protocol("fast", doc="as fast as the simulators can"),
        Protocol(
            "paper",
            real_time=True,
            before=5.0,
            study=True,
            doc="as the reference study: its rules, real time, recorded from 5 s before to 60 s "
            "after",
        ),
        Protocol(
            "smoke", repetitions=1, smallest=True, doc="the smallest run that exercises every part"
        ),
    )
}
"""The study's time-outs (900 s, 600 s) are the tasks' own and hold in every protocol."""
