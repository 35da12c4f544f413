"""CPU and memory of a worker and its children, seen from outside; whether it had a processor.

A look at one process costs about 30 us of CPU, a look for children about 600 us on a quiet machine
(measured with psutil 7 on Linux): 0.1 % of a core at 10 Hz.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from statistics import fmean, stdev
from typing import Any, NamedTuple

import psutil

MB = 1e6
"""Bytes of one MB here and in the records, as the worker counts its own peak."""

THREAD, TELLER = "simbench-sampler", "simbench-memory"
"""Names of the threads that look, and that tell of too much memory."""

LISTING_INTERVAL = 1.0
"""Wall seconds between two looks for new children: listing reads every process of the machine."""

CROWDED = 0.2
"""A worker that waited for more than this share of its time was held up. With three busy processes
on two cores each waited for 0.3 to 0.5."""


class ResourceSample(NamedTuple):
    """One look at the tree: `time` since the start [s], CPU in [% of a core], RSS in [MB]."""

    time: float
    phase: str
    cpu_percent: float
    rss_mb: float


@dataclass(frozen=True)
class MeanAndStd:
    """Mean and standard deviation (of the sample: n - 1; 0 for a single one)."""

    mean: float
    std: float

    @classmethod
    def of(cls, values: Iterable[float]) -> MeanAndStd:
        """Of at least one value."""
        found = list(values)
        return cls(fmean(found), stdev(found) if len(found) > 1 else 0.0)

    def to_wire(self) -> dict[str, float]:
        return {"mean": round(self.mean, 3), "std": round(self.std, 3)}


@dataclass(frozen=True)
class ResourceUse:
    """What a process tree used.

    Attributes:
        peak_mb: largest resident memory [MB]: the exact one where the worker reported it,
            or the largest sample of the tree where that is larger; None without both.
    """

    samples: tuple[ResourceSample, ...] = ()
    peak_mb: float | None = None

    @property
    def cpu_percent(self) -> MeanAndStd | None:
        """CPU of the tree [% of a core]; None without samples."""
        return MeanAndStd.of(s.cpu_percent for s in self.samples) if self.samples else None

    @property
    def rss_mb(self) -> MeanAndStd | None:
        """Resident memory of the tree [MB]; None without samples."""
        return MeanAndStd.of(s.rss_mb for s in self.samples) if self.samples else None

    def phases(self) -> dict[str, ResourceUse]:
        """The samples by phase, in the order the phases began."""
        found: dict[str, list[ResourceSample]] = {}
        for sample in self.samples:
            found.setdefault(sample.phase, []).append(sample)
        return {
            phase: ResourceUse(tuple(samples), max(s.rss_mb for s in samples))
            for phase, samples in found.items()
        }

    def to_wire(self) -> dict[str, Any]:
        """The `resources` of a record."""
        found = self._told()
        peak = None if self.peak_mb is None else round(self.peak_mb, 3)
        found["rss_mb"] = {**(found["rss_mb"] or {}), "peak": peak}
        return {**found, "phases": {phase: use._told() for phase, use in self.phases().items()}}

    def _told(self) -> dict[str, Any]:
        cpu, rss = self.cpu_percent, self.rss_mb
        return {
            "cpu_percent": cpu.to_wire() if cpu else None,
            "rss_mb": rss.to_wire() if rss else None,
            "samples": len(self.samples),
        }


@dataclass
class _Tree:
    """A process and its children. CPU time is also that of children that have ended, which the
    kernel adds to who waited for them."""

    root: psutil.Process
    members: dict[int, psutil.Process] = field(default_factory=dict)
    listed: float = float("-inf")
    looked: float = float("-inf")
    used: float = 0.0

    def look(self, now: float) -> tuple[float, float]:
        """CPU [% of a core] since the last look and RSS [MB] of all that live.

        Raises:
            psutil.NoSuchProcess: the root has ended.
        """
        if now - self.listed >= LISTING_INTERVAL:
            self.listed = now
            self.members = {p.pid: p for p in (self.root, *self.root.children(recursive=True))}
        used = rss = 0.0
        for process in list(self.members.values()):
            try:
                with process.oneshot():
                    seconds = sum(process.cpu_times()[:4])  # user, system, and of its children
                    size = process.memory_info().rss
            except (psutil.NoSuchProcess, psutil.AccessDenied):
                if process is self.root:
                    raise psutil.NoSuchProcess(process.pid) from None
                del self.members[process.pid]
                continue
            if process is self.root and size == 0:  # ended, and not yet waited for
                raise psutil.NoSuchProcess(process.pid)
            used += seconds
            rss += size / MB
        percent = max(0.0, 100 * (used - self.used) / (now - self.looked))  # 0 at the first look
        self.looked, self.used = now, used
        return percent, rss


class ResourceSampler:
    """Samples a process and all its children until it is stopped or the process ends.

    Set `phase` at any time: every sample is tagged with the phase of its moment. A process that
    dies ends the sampling and keeps the samples; one that is already gone gives none. One thread
    serves all samplers of this process.

    Args:
        interval: between two samples [s]; the study's 10 Hz.
        limit_mb: memory the tree may use [MB], or None.
        on_limit: called once, in a thread of its own, with the RSS [MB], when it uses more.

    Attributes:
        due: `time.perf_counter()` of the next sample [s].
    """

    def __init__(
        self,
        pid: int,
        interval: float = 0.1,
        *,
        limit_mb: float | None = None,
        on_limit: Callable[[float], object] | None = None,
    ) -> None:
        self.phase = "launch"
        self.pid = pid
        self.interval = interval
        self.limit_mb = limit_mb
        self._on_limit = on_limit
        self._samples: list[ResourceSample] = []
        self._began = time.perf_counter()
        self.due = self._began + interval
        try:
            self._tree = _Tree(psutil.Process(pid))
            self._tree.look(self._began)
        except psutil.Error:
            return
        _looks.add(self)

    def __enter__(self) -> ResourceSampler:
        return self

    def __exit__(self, *exc: object) -> None:
        self.stop()

    @property
    def latest(self) -> ResourceSample | None:
        """The last sample, for a live display."""
        return self._samples[-1] if self._samples else None

    @property
    def active(self) -> bool:
        """Whether samples may still come."""
        return self in _looks

    def stop(self, peak_mb: float | None = None) -> ResourceUse:
        """End the sampling; what was used so far. May be called again.

        Args:
            peak_mb: the exact peak [MB] that the worker itself reported (VmHWM), if any.
        """
        _looks.remove(self)
        samples = tuple(self._samples)
        peaks = [sample.rss_mb for sample in samples]
        if peak_mb is not None:
            peaks.append(peak_mb)
        return ResourceUse(samples, max(peaks, default=None))

    def look(self) -> ResourceSample:
        """Look once, and say when to look again.

        Raises:
            psutil.NoSuchProcess: the process has ended.
        """
        phase, began = self.phase, time.perf_counter()
        cpu, rss = self._tree.look(began)
        now = time.perf_counter()
        self.due += self.interval
        if self.due < now + self.interval / 2:  # late: CPU over a very short time is all rounding
            self.due = now + self.interval
        return ResourceSample(began - self._began, phase, cpu, rss)

    def take(self, sample: ResourceSample) -> None:
        """Keep a sample, and tell of a tree that uses too much memory."""
        self._samples.append(sample)
        limit, tell = self.limit_mb, self._on_limit
        if limit is not None and tell is not None and sample.rss_mb > limit:
            self._on_limit = None
            arguments = (sample.rss_mb,)  # in a thread of its own: sampling goes on, come what may
            threading.Thread(target=tell, args=arguments, name=TELLER, daemon=True).start()


class _Looks:
    """One thread that looks for all samplers, each when it is due, until there are none."""

    def __init__(self) -> None:
        self._samplers: list[ResourceSampler] = []
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None

    def __contains__(self, sampler: ResourceSampler) -> bool:
        return sampler in self._samplers

    def add(self, sampler: ResourceSampler) -> None:
        with self._changed:
            self._samplers.append(sampler)
            if self._thread is None or not self._thread.is_alive():  # after a fork it is not
                self._thread = threading.Thread(target=self._work, name=THREAD, daemon=True)
                self._thread.start()
            self._changed.notify()

    def remove(self, sampler: ResourceSampler) -> None:
        """Once this has returned the sampler gets no sample any more."""
        with self._changed:
            if sampler in self._samplers:
                self._samplers.remove(sampler)
                self._changed.notify()

    def _work(self) -> None:
        while sampler := self._next():
            try:
                sample = sampler.look()
            except psutil.Error:
                self.remove(sampler)
                continue
            with self._changed:
                if sampler in self._samplers:
                    sampler.take(sample)

    def _next(self) -> ResourceSampler | None:
        """The first that is due, when it is; None when there are no more."""
        with self._changed:
            while self._samplers:
                first = min(self._samplers, key=lambda sampler: sampler.due)
                seconds = first.due - time.perf_counter()
                if seconds <= 0.0:
                    return first
                self._changed.wait(seconds)
            self._thread = None
            return None


_looks = _Looks()


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
    """What a late worker's error says of a machine that was too full; nothing if it was not."""
    computed, waited = scheduled(pid)
    if waited <= CROWDED * (computed + waited):
        return ""
    return (
        f"; its threads waited {waited:.0f} s for a processor and computed {computed:.0f} s, so "
        "the machine had too much to do: ask for fewer --sim-jobs, or end what else runs"
    )
