"""The log file of a worker, seen from the pytest process."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

TAIL_LINES = 30
TAIL_BYTES = 8192

LARGEST = 64 * 2**20
"""A log of more than this [bytes] is cut down, so that a worker that floods it fills no disk."""

KEPT = 2**20
"""What remains of a log that was cut down: its end [bytes]."""


def tail_of_log(log: Path | None) -> str:
    """The last lines; nothing if there is no log, or no longer."""
    if log is None or not log.is_file():
        return ""
    with contextlib.suppress(OSError):
        lines = _end(log, TAIL_BYTES).decode("utf-8", "replace").splitlines()
        return "\n".join(lines[-TAIL_LINES:])
    return ""


def shorten_log(log: Path | None) -> None:
    """Cut an oversized log down to its end. The worker appends, so it may go on meanwhile."""
    if log is None or not log.is_file():
        return
    with contextlib.suppress(OSError):
        if log.stat().st_size > LARGEST:
            end = _end(log, KEPT)
            os.truncate(log, 0)
            with log.open("ab") as file:
                file.write(b"(the log was too long; what follows is its end)\n" + end)


def _end(log: Path, size: int) -> bytes:
    with log.open("rb") as file:
        file.seek(max(0, os.fstat(file.fileno()).st_size - size))
        return file.read(size)
