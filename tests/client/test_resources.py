"""Sampling of real child processes, and of those that do as they are told."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import psutil
import pytest

from pytest_simbench.client import resources
from pytest_simbench.client.resources import (
    LISTING_INTERVAL,
    ResourceSample,
    ResourceSampler,
    ResourceUse,
    _Tree,
)

Start = Callable[[str], "subprocess.Popen[str]"]


@pytest.fixture
def start() -> Iterator[Start]:
    """Starts Python code in a process that says when it is ready; ends it with its children."""
    running: list[subprocess.Popen[str]] = []

    def start(code: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, "-c", textwrap.dedent(code)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        running.append(process)
        assert process.stdout.readline() == "ready\n"
        return process

    yield start
    for process in running:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def go(process: subprocess.Popen[str]) -> None:
    """Let a process that waits for a line go on."""
    process.stdin.write("go\n")
    process.stdin.flush()


IDLE = "print('ready', flush=True); input()"


def until(condition: Callable[[], bool], seconds: float = 15.0) -> None:
    """Wait for something that must happen; how soon depends on the machine's load."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(0.02)


def test_cpu_seconds_agree_with_the_processs_own(start: Start) -> None:
    """CPU % over the sampled time is what the process itself counts, however busy the machine."""
    process = start(
        """
        import os, time
        print('ready', flush=True); input()
        began = time.process_time()
        while time.process_time() - began < 0.8: pass
        print('done', flush=True); input()
        """
    )
    sampler = ResourceSampler(process.pid)
    go(process)
    assert process.stdout.readline() == "done\n"
    seen = len(sampler._samples)
    until(lambda: len(sampler._samples) > seen + 1)
    samples = sampler.stop().samples
    edges = [0.0, *(sample.time for sample in samples)]
    seconds = sum(
        sample.cpu_percent / 100 * (edge - before)
        for sample, before, edge in zip(samples, edges, edges[1:], strict=False)
    )
    assert seconds == pytest.approx(0.8, abs=0.1)  # the kernel counts in 10 ms


def test_a_child_that_comes_later_and_goes_is_followed(start: Start) -> None:
    process = start(
        """
        import subprocess, sys
        print('ready', flush=True); input()
        code = "b = bytearray(b'x') * (100_000_000); input()"
        child = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE)
        input()
        child.kill(); child.wait()
        input()
        """
    )
    with ResourceSampler(process.pid, 0.05) as sampler:
        go(process)
        until(lambda: sampler.latest is not None and sampler.latest.rss_mb > 100)
        go(process)
        until(lambda: sampler.latest is not None and sampler.latest.rss_mb < 50)


def test_samples_of_a_process_that_dies_are_kept(start: Start) -> None:
    process = start(IDLE)
    sampler = ResourceSampler(process.pid, 0.02)
    until(lambda: len(sampler._samples) > 3)
    process.kill()  # and stays a zombie: nobody waits for it yet
    until(lambda: not sampler.active)
    use = sampler.stop()
    assert len(use.samples) > 3
    assert min(sample.rss_mb for sample in use.samples) > 1  # none of the dead process
    assert sampler.stop() == use


def test_a_process_that_is_already_gone_gives_no_samples() -> None:
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    use = ResourceSampler(process.pid, 0.02).stop()
    assert use == ResourceUse()
    assert use.to_wire() == {
        "cpu_percent": None,
        "rss_mb": {"peak": None},
        "samples": 0,
        "phases": {},
    }


def test_the_workers_own_peak_wins_where_it_is_higher(start: Start) -> None:
    with ResourceSampler(start(IDLE).pid, 0.02) as sampler:
        until(lambda: len(sampler._samples) > 1)
    sampled = sampler.stop().peak_mb
    assert sampler.stop(peak_mb=sampled + 7).peak_mb == sampled + 7
    assert sampler.stop(peak_mb=1).peak_mb == sampled


def test_the_wire_form_is_that_of_the_record() -> None:
    samples = (
        ResourceSample(0.1, "load", 50, 100),
        ResourceSample(0.2, "step", 90, 110),
        ResourceSample(0.3, "step", 110, 120),
    )
    use = ResourceUse(samples, 130.123456)
    assert {phase: part.peak_mb for phase, part in use.phases().items()} == {
        "load": 100,
        "step": 120,
    }
    wire = use.to_wire()
    assert json.loads(json.dumps(wire)) == {
        "cpu_percent": {"mean": 83.333, "std": 30.551},
        "rss_mb": {"mean": 110, "std": 10, "peak": 130.123},
        "samples": 3,
        "phases": {
            "load": {
                "cpu_percent": {"mean": 50, "std": 0},
                "rss_mb": {"mean": 100, "std": 0},
                "samples": 1,
            },
            "step": {
                "cpu_percent": {"mean": 100, "std": 14.142},
                "rss_mb": {"mean": 115, "std": 7.071},
                "samples": 2,
            },
        },
    }


class Process:
    """A process as psutil shows it; children are new objects at each listing."""

    now = 0.0

    def __init__(self, pid: int, percent: float, rss: int, *children: Process) -> None:
        self.pid, self.percent, self.rss, self.direct = pid, percent, rss, list(children)
        self.gone = False
        self.listings, self.ended = 0, 0.0

    @contextmanager
    def oneshot(self) -> Iterator[None]:
        yield

    def cpu_times(self) -> tuple[float, ...]:
        if self.gone:
            raise psutil.NoSuchProcess(self.pid)
        return self.percent / 100 * Process.now, 0.0, self.ended, 0.0

    def memory_info(self) -> SimpleNamespace:
        return SimpleNamespace(rss=self.rss)

    def children(self, recursive: bool = False) -> list[Process]:
        self.listings += 1
        found = [Process(c.pid, c.percent, c.rss, *c.direct) for c in self.direct]
        return (
            [*found, *(g for c in found for g in c.children(recursive=True))]
            if recursive
            else found
        )


def look(tree: _Tree, now: float) -> tuple[float, float]:
    Process.now = now
    return tree.look(now)


def test_a_tree_is_the_sum_of_all_generations() -> None:
    found = _Tree(
        Process(1, 10.0, 1_000_000, Process(2, 20.0, 2_000_000, Process(3, 40.0, 4_000_000)))
    )
    assert look(found, 0.0) == (0.0, pytest.approx(7.0))
    assert look(found, 0.1) == (pytest.approx(70.0), pytest.approx(7.0))


def test_children_are_listed_once_a_second() -> None:
    root = Process(1, 10.0, 1_000_000, Process(2, 20.0, 2_000_000))
    found = _Tree(root)
    for now, listings in ((0.0, 1), (0.5, 1), (LISTING_INTERVAL, 2), (1.9, 2), (2.1, 3)):
        cpu, _ = look(found, now)
        assert root.listings == listings
        assert cpu == (0.0 if now == 0.0 else pytest.approx(30.0))


def test_a_child_that_nobody_saw_counts_once_it_has_ended() -> None:
    root = Process(1, 10.0, 1_000_000)
    found = _Tree(root)
    look(found, 0.0)
    root.ended = 0.2
    assert [look(found, now)[0] for now in (0.5, 1.0)] == pytest.approx([50.0, 10.0])


def test_a_child_that_is_gone_is_left_out_and_the_others_counted() -> None:
    kids = [Process(n, 20.0, 2_000_000) for n in (2, 3, 4)]
    found = _Tree(Process(1, 10.0, 1_000_000, *kids))
    look(found, 0.0)
    found.members[2].gone = True
    assert look(found, 0.1) == (pytest.approx(50.0), 5.0)
    assert list(found.members) == [1, 3, 4]


@pytest.mark.parametrize("end", ["gone", "zombie"])
def test_a_root_that_has_ended_ends_the_sampling_and_is_named(end: str) -> None:
    root = Process(17, 10.0, 0 if end == "zombie" else 1_000_000)
    root.gone = end == "gone"
    with pytest.raises(psutil.NoSuchProcess) as caught:
        _Tree(root).look(0.0)
    assert caught.value.pid == 17


class Clock:
    """Time that passes only when somebody looks."""

    def __init__(self, looks: Sequence[float]) -> None:
        self.now = 0.0
        self.looks = list(looks)

    def perf_counter(self) -> float:
        return self.now

    def look(self, now: float) -> tuple[float, float]:
        self.now += self.looks.pop(0)
        return 50.0, 100.0


def sampler(interval: float = 0.1, **options: Any) -> ResourceSampler:
    """Of this process, which nobody samples yet."""
    found = ResourceSampler(psutil.Process().pid, interval, **options)
    found.stop()
    return found


def sampled(monkeypatch: pytest.MonkeyPatch, looks: Sequence[float]) -> list[ResourceSample]:
    """What a sampler at 10 Hz takes whose looks last so long [s]."""
    clock = Clock(looks)
    monkeypatch.setattr(resources, "time", clock)
    found = sampler()
    found._tree = clock
    while clock.looks:
        clock.now = found.due
        found.take(found.look())
    return found._samples


@pytest.mark.parametrize(
    ("looks", "times"),
    [
        ([0.0] * 4, [0.1, 0.2, 0.3, 0.4]),
        ([0.04] * 4, [0.1, 0.2, 0.3, 0.4]),  # looks cost nothing of the rhythm
        ([0.06, 0.0, 0.0, 0.0], [0.1, 0.26, 0.36, 0.46]),  # late: the next is a whole one later
        ([0.17, 0.0, 0.0, 0.0], [0.1, 0.37, 0.47, 0.57]),
    ],
)
def test_samples_come_in_a_rhythm_and_never_too_soon(
    monkeypatch: pytest.MonkeyPatch, looks: list[float], times: list[float]
) -> None:
    assert [s.time for s in sampled(monkeypatch, looks)] == pytest.approx(times)


def test_samples_carry_the_phase_of_their_moment() -> None:
    found = sampler()
    for phase in ("load", "step"):
        found.phase = phase
        assert found.look().phase == phase


def test_a_limit_is_exceeded_only_above_it_and_told_once() -> None:
    for limit, expected in ((100.0, []), (99.9, [100.0])):
        told: list[float] = []
        found = sampler(limit_mb=limit, on_limit=told.append)
        for _ in range(3):
            found.take(ResourceSample(0.1, "step", 50.0, 100.0))
        for thread in threading.enumerate():
            if thread.name == resources.TELLER:
                thread.join()
        assert told == expected


def test_one_thread_serves_all_and_ends_with_the_last() -> None:
    pid = psutil.Process().pid
    with ResourceSampler(pid, 0.01) as one, ResourceSampler(pid, 10.0) as other:
        assert (one.phase, one.pid) == ("launch", pid)
        threads = [t for t in threading.enumerate() if t.name == resources.THREAD]
        assert len(threads) == 1
        assert threads[0].daemon
        assert one.active
        assert other.active
    threads[0].join(5.0)
    assert not threads[0].is_alive()
    with ResourceSampler(pid, 0.01) as again:
        while again.latest is None:
            assert again.active
