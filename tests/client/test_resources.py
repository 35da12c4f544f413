"""Sampling of real child processes: one that burns CPU, one that takes memory, ones that die."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable, Iterator

import psutil
import pytest

from pytest_simbench.client.resources import (
    MeanAndStd,
    ResourceSample,
    ResourceSampler,
    ResourceUse,
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
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        return process

    yield start
    for process in running:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def go(process: subprocess.Popen[str]) -> None:
    """Let a process that waits for a line go on."""
    assert process.stdin is not None
    process.stdin.write("go\n")
    process.stdin.flush()


IDLE = "print('ready', flush=True); input()"
ALLOCATE = """
    print('ready', flush=True); input()
    block = bytearray(b'x') * (200_000_000)
    input()
"""


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
    assert process.stdout is not None
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


def test_memory_of_a_child_counts_as_the_workers(start: Start) -> None:
    process = start(
        """
        import subprocess, sys
        child = subprocess.Popen(
            [sys.executable, "-c", "b = bytearray(b'x') * (100_000_000); print('ready'); input()"],
            stdin=subprocess.PIPE)
        child.wait()
        """
    )
    with ResourceSampler(process.pid, 0.05) as sampler:
        until(lambda: sampler.latest is not None and sampler.latest.rss_mb > 100)


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


def test_samples_carry_the_phase_of_their_moment(start: Start) -> None:
    process = start(ALLOCATE)
    with ResourceSampler(process.pid, 0.02) as sampler:
        sampler.phase = "load"
        until(lambda: sampler.latest is not None and sampler.latest.phase == "load")
        go(process)
        until(lambda: sampler.latest is not None and sampler.latest.rss_mb > 200)
        sampler.phase = "step"
        until(lambda: sampler.latest is not None and sampler.latest.phase == "step")
        use = sampler.stop()
    phases = use.phases()
    assert list(phases)[-2:] == ["load", "step"]
    step = phases["step"].rss_mb
    assert step is not None
    assert step.mean == pytest.approx(psutil.Process(process.pid).memory_info().rss / 1e6, rel=0.01)
    assert sum(len(phase.samples) for phase in phases.values()) == len(use.samples)


def test_memory_is_in_millions_of_bytes(start: Start) -> None:
    """Not in MiB, which are 5 % more: samples, mean and peak."""
    process = start(ALLOCATE)
    go(process)
    look = psutil.Process(process.pid)
    until(lambda: look.memory_info().rss > 200e6)
    with ResourceSampler(process.pid, 0.02) as sampler:
        until(lambda: len(sampler._samples) > 3)
    use, now = sampler.stop(), look.memory_info().rss
    assert use.rss_mb is not None
    assert 1e6 * use.samples[-1].rss_mb == pytest.approx(now, rel=0.01)
    assert 1e6 * use.rss_mb.mean == pytest.approx(now, rel=0.01)
    assert 1e6 * (use.peak_mb or 0) == pytest.approx(now, rel=0.01)


def test_the_memory_limit_is_reported_once_and_can_end_the_process(start: Start) -> None:
    process = start(ALLOCATE)
    seen: list[float] = []

    def end(rss_mb: float) -> None:
        seen.append(rss_mb)
        process.kill()

    sampler = ResourceSampler(process.pid, 0.02, limit_mb=100, on_limit=end)
    time.sleep(0.1)
    assert not seen
    go(process)
    assert process.wait(timeout=15) == -signal.SIGKILL
    sampler.stop()
    until(lambda: len(seen) == 1)
    assert seen[0] > 100


def test_an_error_in_the_callback_does_not_end_the_sampling(start: Start) -> None:
    process = start(IDLE)

    def fail(rss_mb: float) -> None:
        raise ProcessLookupError

    with ResourceSampler(process.pid, 0.02, limit_mb=0.1, on_limit=fail) as sampler:
        until(lambda: sampler.callback_error is not None)
        seen = len(sampler._samples)
        until(lambda: len(sampler._samples) > seen + 1)
        assert isinstance(sampler.callback_error, ProcessLookupError)


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
    assert sampled is not None
    assert sampler.stop(peak_mb=sampled + 7).peak_mb == sampled + 7
    assert sampler.stop(peak_mb=1).peak_mb == sampled


def test_the_wire_form_is_that_of_the_record() -> None:
    samples = (
        ResourceSample(0.1, "load", 50, 100),
        ResourceSample(0.2, "step", 90, 110),
        ResourceSample(0.3, "step", 110, 120),
    )
    wire = ResourceUse(samples, 130.0).to_wire()
    assert json.loads(json.dumps(wire)) == {
        "cpu_percent": {"mean": 83.333, "std": 30.551},
        "rss_mb": {"mean": 110, "std": 10, "peak": 130},
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


def test_spread_of_a_single_sample_is_none() -> None:
    assert MeanAndStd.of([3.0]) == MeanAndStd(3.0, 0.0)
