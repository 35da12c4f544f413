"""pytest-benchmark's timer. Imported when tests are collected: standard library only."""

from __future__ import annotations


class WorkerClock:
    """It advances by the seconds that a worker spent stepping."""

    __name__ = "simbench_worker_seconds"

    def __init__(self) -> None:
        self.seconds = 0.0

    def __call__(self) -> float:
        return self.seconds


worker_clock = WorkerClock()
