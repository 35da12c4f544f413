"""Whether a worker that is late had a processor to compute on."""

from __future__ import annotations

import contextlib
from pathlib import Path

CROWDED = 0.2
"""A worker that waited for more than this share of its time was held up. With three busy processes
on two cores each waited for 0.3 to 0.5."""


def scheduled(pid: int, proc: Path = Path("/proc")) -> tuple[float, float]:
    """How long the living threads of a process computed, and waited for a processor [s].

    From the kernel's `schedstat` (Linux). Both are 0 where it does not tell, or the process is
    gone.
    """
    computed = waited = 0.0
    with contextlib.suppress(OSError, ValueError):
        for thread in (proc / str(pid) / "task").iterdir():
            on, off = (thread / "schedstat").read_text().split()[:2]
            computed += float(on) / 1e9
            waited += float(off) / 1e9
    return computed, waited


def crowding(pid: int) -> str:
    """What a late worker's error says of a machine that was too full; nothing if it was not.

    Args:
        pid: of a process on this machine.
    """
    computed, waited = scheduled(pid)
    if waited <= CROWDED * (computed + waited):
        return ""
    return (
        f"; its threads waited {waited:.0f} s for a processor and computed {computed:.0f} s, so "
        "the machine had too much to do: ask for fewer --sim-jobs, or end what else runs"
    )
