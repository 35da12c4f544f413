"""A worker that is late on a full machine says so."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from pytest_simbench.client.crowding import crowding, scheduled
from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.tasks.base import Count, Outcome
from tests.tiny import Falling


@contextmanager
def core_shared_with(others: int, pid: int) -> Iterator[None]:
    """A process's main thread has one core, which `others` processes use without rest.

    Each is in a session of its own: Linux shares a core out among sessions (`man 7 sched`).
    """
    cores = os.sched_getaffinity(pid)
    os.sched_setaffinity(pid, {min(cores)})
    command = ["taskset", "-c", str(min(cores)), sys.executable, "-c", "while True: pass"]
    hogs = [subprocess.Popen(command, start_new_session=True) for _ in range(others)]
    try:
        yield
    finally:
        for hog in hogs:
            hog.kill()
            hog.wait()


class Crowded(Falling):
    """Falls for ever, on a core that is shared with four others once the world is there."""

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        assert world.process.pid is not None
        with core_shared_with(4, world.process.pid), world.phase("fall"):
            world.wait(1e6)
        return Outcome()


def threads(proc: Path, *stats: str) -> None:
    for number, stat in enumerate(stats):
        folder = proc / "7" / "task" / str(number)
        folder.mkdir(parents=True)
        (folder / "schedstat").write_text(stat)


def test_a_late_worker_on_a_full_core_says_so(case: Case) -> None:
    record, _ = Repetition(Experiment(replace(case, timeout=8.0), Crowded()), 1).run()
    assert record.error is not None
    assert (record.error.type, record.error.phase) == ("RepetitionTimeout", "fall")
    assert "waited" in record.error.message
    assert "--sim-jobs" in record.error.message


def test_all_threads_count(tmp_path: Path) -> None:
    threads(tmp_path, "3000000000 500000000 12\n", "1000000000 1500000000 5\n")
    assert scheduled(7, tmp_path) == (4.0, 2.0)


@pytest.mark.parametrize("stat", ["", "nothing"])
def test_a_kernel_that_does_not_tell_is_no_full_machine(tmp_path: Path, stat: str) -> None:
    threads(tmp_path, stat)
    assert scheduled(7, tmp_path) == (0.0, 0.0)
    assert scheduled(8, tmp_path) == (0.0, 0.0)


@pytest.mark.parametrize(("waited", "told"), [(2.4, False), (2.6, True)])
def test_a_little_waiting_is_not_told(
    monkeypatch: pytest.MonkeyPatch, waited: float, told: bool
) -> None:
    """A fifth of the time is the limit: 2.5 of 12.5 s."""
    monkeypatch.setattr("pytest_simbench.client.crowding.scheduled", lambda pid: (10.0, waited))
    assert bool(crowding(7)) is told
