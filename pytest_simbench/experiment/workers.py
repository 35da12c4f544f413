"""Workers that wait for the next repetition: of engines whose start is costly, and of tasks that
take less time than a start."""

from __future__ import annotations

import threading
from contextlib import suppress
from dataclasses import replace

from pytest_simbench.client.errors import WorkerError
from pytest_simbench.client.launch import Launch
from pytest_simbench.client.process import WorkerProcess


class IdleWorkers:
    """Living workers between two repetitions; safe to use from several threads."""

    def __init__(self) -> None:
        self._idle: list[WorkerProcess] = []
        self._lock = threading.Lock()

    def take(self, launch: Launch) -> WorkerProcess | None:
        """A living worker that was started like that, but for its log; it belongs to the caller
        now. None when there is none. Others are ended: whoever asks needs no more of them."""
        with self._lock:
            while self._idle:
                process = self._idle.pop()
                if process.alive and replace(process.launch, log=launch.log) == launch:
                    return process
                process.kill()
        return None

    def give(self, process: WorkerProcess) -> None:
        """Keep a worker for the next repetition."""
        process.deadline = None
        with self._lock:
            self._idle.append(process)

    def close(self) -> None:
        """End all of them."""
        with self._lock:
            while self._idle:
                with suppress(WorkerError):
                    self._idle.pop().close()
