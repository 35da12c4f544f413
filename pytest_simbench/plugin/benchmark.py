"""pytest-benchmark, where it is at work: repetitions are its rounds, workers' seconds its time.

Imported when tests are collected: standard library and pytest only.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import Any

import pytest


class WorkerClock:
    """pytest-benchmark's timer: it advances by the seconds that a worker spent stepping."""

    __name__ = "simbench_worker_seconds"

    def __init__(self) -> None:
        self.seconds = 0.0

    def __call__(self) -> float:
        return self.seconds


worker_clock = WorkerClock()


def has_benchmark(plugins: pytest.PytestPluginManager) -> bool:
    """Whether pytest-benchmark is at work (it is not under `-p no:benchmark`)."""
    module = sys.modules.get("pytest_benchmark.plugin")
    return module is not None and plugins.is_registered(module)


def time_by_workers(plugins: pytest.PytestPluginManager, items: Iterable[pytest.Item]) -> None:
    """Have pytest-benchmark, where it is at work, take the workers' seconds as its time."""
    for item in items if has_benchmark(plugins) else ():
        group = item.name.partition("[")[0]
        item.add_marker(pytest.mark.benchmark(timer=worker_clock, group=group))


@pytest.fixture
def benchmark_rounds(request: pytest.FixtureRequest, benchmark: Any) -> Any:
    """What takes the repetitions as rounds: pytest-benchmark's fixture.

    A test that is run again (pytest-rerunfailures) replaces the rounds of its first attempt, which
    would else be in the saved file a second time. A conftest's own `benchmark` takes no rounds.
    """
    from pytest_benchmark.fixture import BenchmarkFixture

    if not isinstance(benchmark, BenchmarkFixture):
        return None
    saved = getattr(getattr(request.config, "_benchmarksession", None), "benchmarks", [])
    saved[:] = [rounds for rounds in saved if rounds.fullname != benchmark.fullname]
    return benchmark


@pytest.fixture
def no_rounds() -> None:
    """Nothing takes the repetitions as rounds."""
