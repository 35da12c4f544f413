"""pytest-benchmark, where it is at work: repetitions are its rounds, workers' seconds its time.

Imported when tests are collected: standard library and pytest only.
"""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from pytest_simbench.measure.results import ResultSet
    from pytest_simbench.records.description import TaskDescription

Group = tuple[Any, Sequence[Mapping[str, Any]]]
"""Name and benchmarks, as the hook `pytest_benchmark_group_stats` gives them."""

SAVED = ("simulator", "mode", "profile", "protocol")
SAVED_COSTS = ("rtf", "cpu", "ram", "ram_peak", "cpu_cost", "start", "end", "total")


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
    """Have pytest-benchmark, where it is at work, take the workers' seconds as its time. It reads
    the closest mark alone, so what a mark of the test says goes into ours."""
    for item in items if has_benchmark(plugins) else ():
        own = item.get_closest_marker("benchmark")
        options = {"group": item.name.partition("[")[0], **(own.kwargs if own else {})}
        mark = pytest.mark.benchmark(**{**options, "timer": worker_clock})
        item.add_marker(mark, append=False)


def shown(config: pytest.Config, groups: Sequence[Group]) -> Sequence[Group]:
    """The groups of pytest-benchmark's table without our benchmarks, which our own result tells
    of; with them where one of its options is given."""
    given = [*config.invocation_params.args, *config.getini("addopts")]
    given += shlex.split(os.environ.get("PYTEST_ADDOPTS", ""))
    if any(str(argument).startswith("--benchmark-") for argument in given):
        return groups
    from pytest_simbench.records.baseline import KEY

    others = [(name, [b for b in found if KEY not in b["extra_info"]]) for name, found in groups]
    return [(name, found) for name, found in others if found]


@pytest.fixture
def benchmark_rounds(request: pytest.FixtureRequest, benchmark: Any) -> Iterator[Any]:
    """What takes the repetitions as rounds: pytest-benchmark's fixture.

    A test that is run again (pytest-rerunfailures) replaces the rounds of its first attempt, which
    would else be in the saved file a second time. A conftest's own `benchmark` takes no rounds.
    """
    from pytest_benchmark.fixture import BenchmarkFixture

    if not isinstance(benchmark, BenchmarkFixture):
        yield None
        return
    saved = getattr(getattr(request.config, "_benchmarksession", None), "benchmarks", [])
    saved[:] = [rounds for rounds in saved if rounds.fullname != benchmark.fullname]
    yield benchmark
    benchmark.skipped = True  # else it warns of a test that failed before there were rounds


@pytest.fixture
def no_rounds() -> None:
    """Nothing takes the repetitions as rounds."""


def give_rounds(
    benchmark: Any, results: Sequence[ResultSet], described: Iterable[TaskDescription]
) -> None:
    """Hand the finished repetitions to pytest-benchmark as rounds of worker seconds.

    pytest-benchmark has one result for a test: rounds are those of its first task of which any
    finished. The records are of all its tasks.
    """
    from pytest_simbench.records import baseline

    result = next((result for result in results if result.ok), None)
    if result is None:
        return
    seconds = iter([record.stepping["wall"] for record in result.ok])

    def advance() -> None:
        worker_clock.seconds += next(seconds, 0.0)

    first = result.ok[0]
    benchmark.extra_info.update(
        {
            **{name: getattr(first, name) for name in SAVED},
            **{name: dict(getattr(first, name)) for name in ("settings", "versions", "host")},
            "crashed": len(result.crashed),
            "metrics": {name: [r.metrics.get(name) for r in result.ok] for name in result.metrics},
            "seeds": [record.seed for record in result.ok],
            "costs": {name: [record.cost(name) for record in result.ok] for name in SAVED_COSTS},
            baseline.KEY: baseline.to_extra_info(
                (r for found in results for r in found.records), described
            ),
        }
    )
    benchmark.pedantic(advance, rounds=len(result.ok), iterations=1, warmup_rounds=0)
