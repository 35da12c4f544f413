"""CPU time of a process and of all that it started: an engine may work in helpers of its own.

Linux alone tells who they are (`man proc`, `children`); elsewhere only those that have ended count.
"""

from __future__ import annotations

import os
import resource
import time
from contextlib import suppress


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
