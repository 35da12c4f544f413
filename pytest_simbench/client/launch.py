"""What a worker is started with, and the log that it leaves."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

TAIL_LINES = 30
TAIL_BYTES = 8192

LARGEST = 64 * 2**20
"""A log of more than this [bytes] is cut down, so that a worker that floods it fills no disk."""

KEPT = 2**20
"""What remains of a log that was cut down: its end [bytes]."""


@dataclass(frozen=True)
class Launch:
    """How to start a worker.

    Attributes:
        adapter: `module:Class` of the simulator's adapter.
        python: interpreter, None for pytest's own.
        spec: whole execnet specification, which overrides `python` (another host).
        environment: variables set in the worker's environment.
        log: file that takes all of the worker's output, None to leave it alone.
        stall_timeout: longest silence before the worker counts as hung, also while it starts [s].
        compile_timeout: for `Simulator.compile` [s], if that is longer; 0 where there is nothing
            to compile.
    """

    adapter: str
    python: str | None = None
    spec: str | None = None
    environment: Mapping[str, str] = field(default_factory=dict)
    log: Path | None = None
    stall_timeout: float = 60.0
    compile_timeout: float = 0.0

    def log_tail(self) -> str:
        """The log's last lines; nothing if there is no log, or no longer."""
        if self.log is not None and self.log.is_file():
            with contextlib.suppress(OSError):
                lines = _end(self.log, TAIL_BYTES).decode("utf-8", "replace").splitlines()
                return "\n".join(lines[-TAIL_LINES:])
        return ""

    def shorten_log(self) -> None:
        """Cut an oversized log down to its end. The worker appends, so it may go on meanwhile."""
        if self.log is None or not self.log.is_file():
            return
        with contextlib.suppress(OSError):
            if self.log.stat().st_size > LARGEST:
                end = _end(self.log, KEPT)
                os.truncate(self.log, 0)
                with self.log.open("ab") as file:
                    file.write(b"(the log was too long; what follows is its end)\n" + end)


def _end(log: Path, size: int) -> bytes:
    with log.open("rb") as file:
        file.seek(max(0, os.fstat(file.fileno()).st_size - size))
        return file.read(size)
