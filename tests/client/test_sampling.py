"""What a sampler looks at and when, with processes and a clock that do as they are told."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
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


class Process:
    """A process as psutil shows it; children are new objects at each listing, equal by pid."""

    def __init__(self, pid: int, percent: float, rss: int, *children: Process) -> None:
        self.pid, self.percent, self.rss, self.direct = pid, percent, rss, list(children)
        self.gone = False
        self.looks = self.listings = 0

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Process) and other.pid == self.pid

    def __hash__(self) -> int:
        return self.pid

    @contextmanager
    def oneshot(self) -> Iterator[None]:
        yield

    def cpu_percent(self) -> float:
        if self.gone:
            raise psutil.NoSuchProcess(self.pid)
        self.looks += 1
        return 0.0 if self.looks == 1 else self.percent  # psutil: between two looks at one object

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


def tree(root: Process) -> _Tree:
    return _Tree(root)  # type: ignore[arg-type]


def test_a_tree_is_the_sum_of_all_generations() -> None:
    found = tree(
        Process(1, 10.0, 1_000_000, Process(2, 20.0, 2_000_000, Process(3, 40.0, 4_000_000)))
    )
    assert found.look(0.0) == (0.0, pytest.approx(7.0))
    assert found.look(0.1) == (pytest.approx(70.0), pytest.approx(7.0))


def test_children_are_listed_once_a_second_and_known_again() -> None:
    """A process seen anew has no CPU % yet: its object must be kept from listing to listing."""
    root = Process(1, 10.0, 1_000_000, Process(2, 20.0, 2_000_000))
    found = tree(root)
    for now, listings in ((0.0, 1), (0.5, 1), (LISTING_INTERVAL, 2), (1.9, 2), (2.1, 3)):
        cpu, _ = found.look(now)
        assert root.listings == listings
        assert cpu == (0.0 if now == 0.0 else 30.0)


def test_another_process_with_the_pid_of_a_dead_one_is_a_new_one() -> None:
    root = Process(1, 10.0, 1_000_000, Process(2, 20.0, 2_000_000))
    found = tree(root)
    found.look(0.0)
    found.members[2].pid = 7  # not the process it was
    assert found.look(LISTING_INTERVAL)[0] == 10.0


def test_a_child_that_is_gone_is_left_out_and_the_others_counted() -> None:
    kids = [Process(n, 20.0, 2_000_000) for n in (2, 3, 4)]
    found = tree(Process(1, 10.0, 1_000_000, *kids))
    found.look(0.0)
    found.members[2].gone = True  # type: ignore[attr-defined]
    assert found.look(0.1) == (50.0, 5.0)
    assert list(found.members) == [1, 3, 4]


@pytest.mark.parametrize("end", ["gone", "zombie"])
def test_a_root_that_has_ended_ends_the_sampling_and_is_named(end: str) -> None:
    root = Process(17, 10.0, 0 if end == "zombie" else 1_000_000)
    root.gone = end == "gone"
    with pytest.raises(psutil.NoSuchProcess) as caught:
        tree(root).look(0.0)
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
    found._tree = clock  # type: ignore[assignment]
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
        assert (one.phase, one.pid, one.callback_error) == ("launch", pid, None)
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


def test_phases_have_their_own_peak_and_the_wire_three_decimals() -> None:
    samples = (
        ResourceSample(0.1, "a", 1, 10.0),
        ResourceSample(0.2, "b", 2, 30.0),
        ResourceSample(0.3, "a", 3, 20.0),
    )
    use = ResourceUse(samples, 30.123456)
    assert {phase: part.peak_mb for phase, part in use.phases().items()} == {"a": 20.0, "b": 30.0}
    assert use.to_wire()["rss_mb"]["peak"] == 30.123
