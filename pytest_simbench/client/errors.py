"""The ways in which a worker can fail, seen from the pytest process."""

from __future__ import annotations

import signal
from dataclasses import dataclass

from pytest_simbench.simulator.external import signal_name


@dataclass
class Where:
    """Where something happened, for messages and records."""

    simulator: str
    mode: str
    repetition: int | None = None
    seed: int | None = None
    phase: str = "launch"

    def __str__(self) -> str:
        parts = [f"{self.simulator} {self.mode}"]
        if self.repetition is not None:
            parts.append(f"repetition {self.repetition}")
        if self.seed is not None:
            parts.append(f"seed {self.seed}")
        return ", ".join([*parts, f"phase {self.phase}"])


class WorkerError(Exception):
    """A repetition's worker failed. The message says what, where, and what to do.

    Attributes:
        what: what happened, without the place.
    """

    def __init__(self, what: str, where: Where, log_tail: str = "") -> None:
        self.what = what
        self.phase = where.phase
        self.log_tail = log_tail
        text = f"{what} [{where}]"
        if log_tail:
            text += "\n--- last lines of the worker's log ---\n" + log_tail
        super().__init__(text)


class WorkerStartError(WorkerError):
    """The worker could not be started, or did not answer the handshake."""


class WorkerExited(WorkerError):
    """The worker's process ended in the middle."""


class WorkerHung(WorkerError):
    """The worker gave no sign of life."""


class RepetitionTimeout(WorkerError):
    """The repetition took longer than its time-out."""


class OutOfMemory(WorkerError):
    """The worker used more memory than allowed, or its allocation failed."""


class Interrupted(WorkerError):
    """The run was interrupted, and the worker ended for that."""


class DisplayLost(WorkerError):
    """The virtual display of a window ended, or could not be started."""


class ProtocolError(WorkerError):
    """The worker sent something that is no answer."""


class WorldParityError(WorkerError):
    """The engine built another world than the scene describes."""


class Diverged(WorkerError):
    """The engine's state is not finite or cannot be: cubes outside the room, inside each other."""


class Unavailable(WorkerError):
    """This machine lacks what was asked for, a driver for instance; such a test is skipped."""


class SceneRefused(Unavailable):
    """The adapter says that it cannot hold the scene, with these settings at least: no fault of the
    simulator, and nothing was simulated."""


class NodeLost(WorkerError):
    """The machines of a cluster that carried the repetition out were lost."""


class BadState(WorkerError):
    """An adapter returned what is no state of the scene: its shape, type or order is wrong."""


class EngineFailed(WorkerError):
    """The engine or its adapter raised an exception, or rejected the scene or settings.

    Attributes:
        remote: name of the exception's class in the worker.
    """

    remote = ""


class PolicyFailed(WorkerError):
    """A policy raised, stalled, or answered what is no command."""


class ExecutorError(Exception):
    """Nothing can be carried out any more: a cluster is gone, for instance. One sentence."""


class DisplayError(Exception):
    """There is no display to be had."""


REMOTE_ERRORS: dict[str, type[WorkerError]] = {
    "ParityError": WorldParityError,
    "DivergedError": Diverged,
    "StateError": BadState,
    "MemoryError": OutOfMemory,
    "UnavailableError": Unavailable,
    "PolicyError": PolicyFailed,
    "SystemExit": WorkerExited,
}
"""Worker-side error names and what they become here; all others are `EngineFailed`."""

REFUSALS = {"compile": SceneRefused, "load": SceneRefused, "close_loop": Unavailable}
"""What a `NotSupportedError` of these operations becomes. A policy may ask for what an engine does
not have, a picture for instance."""


def exit_text(code: int | None) -> str:
    """A process's exit status in words: "was killed by SIGSEGV", "exited with status 3"."""
    if code is None:
        return "broke the connection"
    if code in _OF_A_SHELL:
        return f"exited with status {code}, a shell's word for {_OF_A_SHELL[code]}"
    if code < 0:
        return f"was killed by {signal_name(-code)}"
    return f"exited with status {code}"


_OF_A_SHELL = {128 + number: number.name for number in signal.Signals}
"""What a shell that starts the interpreter makes of a signal that ended it."""
