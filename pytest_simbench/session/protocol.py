"""Protocols: how a repetition is run and what is recorded around it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Protocol:
    """How repetitions are run.

    Attributes:
        name: as given to `--protocol`.
        real_time: step in step with the wall clock.
        before: how long the idle worker is recorded before its simulator starts [s].
        repetitions: default of `--reps`.
        smallest: run the smallest version of each task.
        doc: one sentence for the help.
    """

    name: str
    real_time: bool = False
    before: float = 0.0
    repetitions: int = 20
    smallest: bool = False
    doc: str = ""


PROTOCOLS = {
    protocol.name: protocol
    for protocol in (
        Protocol("fast", doc="as fast as the simulators can"),
        Protocol(
            "paper",
            real_time=True,
            before=5.0,
            doc="as the reference study: real time, recorded from 5 s before to 60 s after",
        ),
        Protocol(
            "smoke", repetitions=1, smallest=True, doc="the smallest run that exercises every part"
        ),
    )
}
"""The study's time-outs (900 s, 600 s) are the tasks' own and hold in every protocol."""
