"""Whose motion, pictures and film are kept, and that they say what happened."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import av
import numpy as np
import pytest

from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.identity import file_stem_of
from pytest_simbench.experiment.photographer import photograph
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.recordings.film import SIZE, Album
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


LANDED = 0.13
"""A cube that falls by 75 mm arrives [s]."""


@dataclass(frozen=True)
class Landing(Falling):
    """Tells in the end when the cubes landed."""

    name: ClassVar[str] = "landing"
    pictured: ClassVar[tuple[str, ...]] = ("fall",)

    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        found = super().perform(world, seed, count)
        with world.phase("rest"):
            world.wait(0.2)
        world.note("landing", LANDED)
        world.note("nothing near", 0.7)
        return found


def test_a_picture_of_each_phase_and_nothing_else(case: Case) -> None:
    experiment = Experiment(case, Falling())
    Repetition(experiment, 1).run()
    before = {path.name: path.stat().st_mtime_ns for path in (case.folder / "logs").iterdir()}
    assert photograph(experiment) == ""
    (path,) = (case.folder / "pictures").glob("*.npz")
    assert path.stem == next(iter(before)).removesuffix(".log")
    pictures = Album.read(path).pictures
    assert list(pictures) == ["after fall"]
    width, height = SIZE
    assert pictures["after fall"].shape == (height, width, 3)
    assert pictures["after fall"].std() > 1  # something is on it
    after = {path.name: path.stat().st_mtime_ns for path in (case.folder / "logs").iterdir()}
    assert after == before
    assert not (case.folder / "pictures" / "traces").exists()
    written = path.stat().st_mtime_ns
    assert photograph(experiment) == ""
    assert path.stat().st_mtime_ns == written  # it is not made again


def test_an_engine_without_a_renderer_is_told(case: Case) -> None:
    told = photograph(Experiment(case.of("ovphysx", **of(case)), Falling()))
    assert told == "ovphysx has no renderer of its own: no pictures and no videos"


def test_a_film_and_a_moment_that_is_known_only_later(case: Case) -> None:
    experiment = Experiment(case, Landing())
    assert photograph(experiment, video=True) == ""
    (path,) = (case.folder / "pictures").glob("*.npz")
    album = Album.read(path)
    assert list(album.pictures) == ["landing", "after fall", "after rest"]
    assert album.times["landing"] == pytest.approx(LANDED, abs=0.021)
    (film,) = (case.folder / "videos").iterdir()
    assert film.stem == path.stem
    with av.open(str(film)) as container:
        times = [float(frame.time) for frame in container.decode(video=0)]
    np.testing.assert_allclose(times, np.arange(20) * 0.04, atol=1e-3)


@pytest.mark.parametrize(
    ("mode", "kept"), [("on", ["1", "unlucky 1"]), ("retain-on-failure", ["unlucky 1"])]
)
def test_whose_film_is_kept(case: Case, mode: str, kept: list[str]) -> None:
    filmed = replace(case, video=mode)
    found = []
    for task in (Falling(), Unlucky()):
        record, _ = Repetition(Experiment(filmed, task), 1).run()
        assert record.notes.filmed
        for path in (case.folder / "videos").glob("*"):
            assert path.stem == file_stem_of(record)
            path.unlink()
            found.append(f"{task.name} 1".removeprefix("falling "))
    assert found == kept
    plain, _ = Repetition(Experiment(case, Falling()), 1).run()
    assert not plain.notes.filmed


def test_a_film_that_cannot_be_drawn_fails_nothing(case: Case) -> None:
    blind = replace(case, video="on", adapter="tests.client.faulty:Blind")
    record, error = Repetition(Experiment(blind, Falling()), 1).run()
    assert error is None
    assert record.notes.video == "mujoco has no offscreen picture"
    assert not record.notes.filmed
    assert not (case.folder / "videos").exists()


def test_what_goes_wrong_is_told(case: Case) -> None:
    lost = Experiment(case, Falling()).in_case(adapter="nowhere:Nothing")
    told = photograph(lost)
    assert told.startswith("mujoco: pictures end early: EngineFailed: ModuleNotFoundError")
    assert "\n" not in told  # of the log: a missing Vulkan device is told here, too
    assert not list((case.folder / "pictures").glob("*.npz"))


def test_a_mistake_of_the_task_is_told(case: Case) -> None:
    told = photograph(Experiment(case, Unlucky()))
    assert told.startswith("mujoco: pictures end early: RuntimeError: bad luck")


def of(case: Case) -> dict[str, object]:
    return {name: getattr(case, name) for name in ("test", "mode", "profile", "folder")}
