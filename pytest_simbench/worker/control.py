"""The clocks of stepping, and what a busy or slow machine does to them.

Two things are measured, and the gate takes both out (`measure.speed`):

- how long the stepping thread waited for a processor that other processes had (`waited`), which
  the kernel knows exactly;
- how fast the machine is meanwhile: a control workload, always the same, runs among the steps. A
  lower clock, a shared cache, a hypervisor that takes the processor away slow both alike; a slower
  engine does not slow the control.

What neither shows is contention that hits an engine's other threads alone, or a GPU.

CPU time is that of the process and of all that it started: an engine may work in helpers of its
own. Linux alone tells who they are (`man proc`, `children`); elsewhere only those that have ended
count.
"""

from __future__ import annotations

import os
import resource
import time
import weakref
from contextlib import suppress

import numpy as np

SHARE = 0.0075
"""Shortest time of the control over that of stepping. Most runs are longer, with cold caches among
the steps: 1.0 to 1.3 % together; the cost to hold is 2 %."""

MOST_AT_ONCE = 50
"""Runs of the workload between two steps: an engine whose steps are slow is not kept waiting."""

SCHEDSTAT = "/proc/thread-self/schedstat"
"""Linux: nanoseconds on a processor, nanoseconds waiting for one, turns (sched-stats.rst)."""

_LOOPS = 1500
_VALUES = np.linspace(0.1, 1.0, 1024)


def workload() -> float:
    """About 0.1 ms of interpreter and of vector arithmetic, in one thread and 8 kB of memory."""
    total = 0
    for k in range(_LOOPS):
        total += k * k % 7
    values = _VALUES
    for _ in range(8):
        values = np.sqrt(values * values + _VALUES)
    return total + float(values[0])


class Clock:
    """Wall time, and how much of it the calling thread waited for a processor.

    Where the kernel does not tell (no Linux, another thread than the one that made the clock) it
    counts as not having waited.
    """

    def __init__(self, path: str = SCHEDSTAT) -> None:
        try:
            self._file = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        except OSError:
            self._file = -1
        else:
            weakref.finalize(self, os.close, self._file)

    def __call__(self) -> tuple[float, float]:
        """Wall seconds now, and seconds waited until just then.

        Read again when another process was let in between the two: on a busy machine that single
        turn is as long as hundreds of runs of the control.
        """
        before = self.waited()
        while True:
            now = time.perf_counter()
            waited = self.waited()
            if waited == before:
                return now, waited
            before = waited

    def waited(self) -> float:
        """Seconds waited until now."""
        return int(os.pread(self._file, 96, 0).split()[1]) / 1e9 if self._file >= 0 else 0.0


class Control:
    """Runs the workload often enough to take its share, and keeps its clocks.

    Attributes:
        runs: of the workload, after two that only warm it up.
        wall: seconds of all runs.
        waited: how much of that the thread waited for a processor.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._least = float("inf")
        for _ in range(2):
            self._run()
        self.runs = 0
        self.wall = self.waited = self.cpu = 0.0

    def keep_up(self, stepping: float) -> None:
        """Run the workload until it has had its share of `stepping` seconds.

        The share is counted in the shortest run so far, not in the runs' own time: else an
        interrupted run would put off the next ones, and the mean would be too small.
        """
        for _ in range(MOST_AT_ONCE):
            if self.runs and self.runs * self._least >= SHARE * stepping:
                return
            wall, waited, cpu = self._run()
            self.runs += 1
            self.wall += wall
            self.waited += waited
            self.cpu += cpu

    def _run(self) -> tuple[float, float, float]:
        cpu = time.thread_time()
        began, waited_before = self._clock()
        workload()
        ended, waited = self._clock()
        wall, waited = ended - began, waited - waited_before
        self._least = min(self._least, wall)
        return wall, waited, time.thread_time() - cpu

    def to_wire(self) -> dict[str, float]:
        """For a record's `stepping`: means of the runs [s]; nothing where it never ran."""
        if not self.runs:
            return {}
        return {
            "control_runs": self.runs,
            "control_wall": self.wall / self.runs,
            "control_waited": self.waited / self.runs,
            "control_cpu": self.cpu / self.runs,
        }


class Family:
    """This process and its descendants.

    Call `meet` where the work begins and ends: who lives then is known from there on, and counts
    from its start, which is in the work if it was not met before.
    """

    def __init__(self) -> None:
        self._known: dict[int, tuple[bool, float]] = {}

    def meet(self) -> None:
        """Look for descendants that started since."""
        waiting = [os.getpid()]
        for parent in waiting:
            for child in _children(parent):
                self._known.setdefault(child, (parent == waiting[0], 0.0))
                waiting.append(child)

    def cpu(self) -> float:
        """CPU seconds so far of all of them together."""
        ended = resource.getrusage(resource.RUSAGE_CHILDREN)
        total = time.process_time() + ended.ru_utime + ended.ru_stime
        for pid, (own, used) in list(self._known.items()):
            try:
                used = time.clock_gettime(~pid << 3 | 2)  # man clock_getcpuclockid
                self._known[pid] = own, used
            except OSError:  # it is gone; a child of ours is among those that have ended now
                used = 0.0 if own else used
            total += used
        return total


def _children(pid: int) -> list[int]:
    found: list[int] = []
    with suppress(OSError):  # the process has ended, or one of its threads
        for thread in os.listdir(f"/proc/{pid}/task"):
            with open(f"/proc/{pid}/task/{thread}/children", encoding="ascii") as children:
                found += map(int, children.read().split())
    return found
