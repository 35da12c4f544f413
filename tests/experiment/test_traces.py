"""Whose motion is kept, and that it says what happened."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest

from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.recordings.trace import FOLDER, Trace
from pytest_simbench.tasks.base import Count, Outcome
from tests.tiny import Falling


@dataclass(frozen=True)
class Unlucky(Falling):
    """Ends badly."""

    name: ClassVar[str] = "unlucky"

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        super().perform(world, seed, count)
        raise RuntimeError("bad luck")


@pytest.mark.parametrize(
    ("when", "kept"),
    [
        ("off", []),
        ("on", ["1", "2", "unlucky 1", "unlucky 2"]),
        ("retain-on-failure", ["unlucky 1", "unlucky 2"]),
        ("first-and-failed", ["1", "unlucky 1", "unlucky 2"]),
        ("first", ["1", "unlucky 1"]),
    ],
)
def test_whose_motion_is_kept(case: Case, when: str, kept: list[str]) -> None:
    case = replace(case, trace=when)
    for task in (Falling(), Unlucky()):
        for number in (1, 2):
            Repetition(Experiment(case, task), number).run()
            for path in (case.folder / FOLDER).glob("*.npz"):
                path.rename(path.with_suffix(f".{task.name} {number}".replace("falling ", "")))
    found = [path.suffix[1:] for path in (case.folder / FOLDER).glob("*")]
    assert sorted(found) == kept


def test_the_motion_of_the_engine_is_in_it(case: Case) -> None:
    Repetition(Experiment(replace(case, trace="on"), Falling()), 1).run()
    (path,) = (case.folder / FOLDER).iterdir()
    trace = Trace.read(path)
    assert trace.figure is None
    assert [box.name for box in trace.free] == ["left", "right"]
    falling = trace.time < 0.1
    height = 0.1 - 9.80665 * trace.time[falling] ** 2 / 2
    np.testing.assert_allclose(trace.bodies[falling, 0, 2], height, atol=1e-3)
    assert {"fall": 0.0}.items() <= {name: time for time, name in trace.phases}.items()


def test_what_is_not_kept_is_not_sampled(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sampling takes time (benchmarks/README.md): what is kept only if it fails is made of the
    looks at the state that are taken anyway."""
    sampled = []
    real = Repetition._write_trace

    def count(self: Repetition, *, failed: bool) -> str:
        assert self._world is not None
        sampled.append(sum(map(len, self._world.trace)))
        return real(self, failed=failed)

    monkeypatch.setattr(Repetition, "_write_trace", count)
    for mode in ("first", "first-and-failed"):
        for number in (1, 2):
            Repetition(Experiment(replace(case, trace=mode), Falling()), number).run()
    assert sampled == [30, 0, 30, 6]


def test_a_task_that_samples_itself_keeps_that(case: Case) -> None:
    """Of a throw that failed there is more than ten samples a second."""

    @dataclass(frozen=True)
    class Watched(Falling):
        def perform(self, world: World, seed: int, count: Count) -> Outcome:
            world.wait(0.2, log_period=0.0)
            world.wait(0.2)
            raise RuntimeError("bad luck")

    case = replace(case, trace="first-and-failed")
    record, error = Repetition(Experiment(case, Watched()), 2).run()
    assert str(error) == "bad luck", record.error
    (path,) = (case.folder / FOLDER).iterdir()
    apart = np.diff(Trace.read(path).time)
    assert sorted(set(apart.round(3))) == [0.02, 0.1, 0.119]
