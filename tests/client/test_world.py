"""What a world keeps of its motion, and pictures along the way."""

from __future__ import annotations

import dataclasses
import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pytest_simbench.client.answers import Frame
from pytest_simbench.client.errors import Diverged, Where
from pytest_simbench.client.process import WorkerProcess
from pytest_simbench.client.world import Motion, World
from pytest_simbench.experiment.case import Case
from pytest_simbench.scene import Pose, Scene
from pytest_simbench.tasks.base import cube

SCENE = Scene("s", (cube("a", Pose.at(0.0, 0.0, 2.0), (1.0,) * 4),))


def test_what_was_undone_is_not_in_it(case: Case) -> None:
    process = WorkerProcess(case.launch("x"), Where(case.simulator, case.mode))
    process.construct()
    world = World(process, SCENE, trace_period=0.02)
    with world.phase("fall"):
        world.wait(0.1)
    world.save()
    with world.phase("lost"):
        world.wait(0.1)
    world.restore()
    with world.phase("fall again"):
        world.wait(0.06)
    process.close()
    motion = Motion.joined(world.trace)
    np.testing.assert_allclose(motion.time, np.arange(1, 9) * 0.02)
    assert (np.diff(motion.bodies[:, 0, 2]) < 0).all()
    begun = {name: round(time, 3) for time, name in world.phases}
    assert begun.items() >= {"fall": 0.0, "fall again": 0.1, "task": 0.16}.items()
    assert "lost" not in begun


def test_what_went_wrong_is_in_it(case: Case) -> None:
    """The motion that ends in a state that cannot be is the one to look at."""
    process = WorkerProcess(case.launch("x"), Where(case.simulator, case.mode))
    process.construct()
    world = World(process, dataclasses.replace(SCENE, gravity=(500.0, 0.0, 0.0)), trace_period=0.02)
    with pytest.raises(Diverged, match="left the room"):
        world.wait(0.4)
    process.close()
    assert Motion.joined(world.trace).bodies[-1, 0, 0] > 5.0


def test_a_long_wait_is_kept_out_of_the_simulators_memory(case: Case) -> None:
    """60 MB of samples: the worker sends them as it goes, else its peak would be the trace's."""
    places = [Pose.at(0.5 * (k % 16), 0.5 * (k // 16), 2.0) for k in range(256)]
    cubes = tuple(cube(f"c{k}", place, (1.0,) * 4) for k, place in enumerate(places))
    scene = Scene("s", cubes, gravity=(0.0, 0.0, 0.0), room=(20.0, 20.0, 4.0))
    peaks = []
    for period in (None, 0.02):
        process = WorkerProcess(case.launch("x"), Where(case.simulator, case.mode))
        process.construct(changes={"timestep": 0.01})
        world = World(process, scene, trace_period=period)
        world.wait(45.0)
        peaks.append(world.stats()["peak_rss_mb"])
        process.close()
    motion = Motion.joined(world.trace)
    np.testing.assert_allclose(motion.time, np.arange(1, 2251) * 0.02)
    assert motion.bodies.nbytes > 55e6
    assert peaks[1] - peaks[0] < 20.0


SIZE = (48, 36)


def fallen(case: Case, film: bool) -> tuple[World, list[Frame]]:
    process = WorkerProcess(case.launch("x"), Where(case.simulator, case.mode))
    process.construct()
    world, frames = World(process, SCENE), []
    deadline = process.deadline = time.monotonic() + 100.0
    if film:
        world.film(frames.append, 0.04, SIZE)
    world.wait(0.1)
    world.wait(0.11)
    if film:
        world.film(None, 0.04, SIZE)
        spent = sum(frame.seconds for frame in frames)
        assert process.deadline == pytest.approx(deadline + spent)
        assert (spent > 0) == (frames[0].picture is not None)
    world.wait(0.1)
    process.close()
    return world, frames


def test_pictures_are_evenly_spaced_and_change_nothing(case: Case) -> None:
    world, frames = fallen(case, film=True)
    assert [frame.time for frame in frames] == pytest.approx([0.04, 0.08, 0.12, 0.16, 0.2])
    for frame in frames:
        assert frame.problem == ""
        assert frame.picture is not None
        assert frame.picture.shape == (36, 48, 3)
    without, none = fallen(case, film=False)
    assert none == []
    np.testing.assert_array_equal(world.bodies, without.bodies)


def test_a_picture_that_cannot_be_drawn_ends_the_film_alone(case: Case) -> None:
    world, frames = fallen(replace(case, adapter="tests.client.faulty:Blind"), film=True)
    assert [frame.problem for frame in frames] == ["mujoco has no offscreen picture"]
    assert world.time == pytest.approx(0.31)


@pytest.mark.parametrize(
    "data",
    [
        None,
        {},
        {"time": 0.0, "seconds": 0.0, "picture": "x"},
        {"time": 0.0, "seconds": 0.0, "picture": {"__array__": ["|u1", [2, 2], b"1234"]}},
        {"time": 0.0, "seconds": 0.0, "picture": {"__array__": ["<f8", [1], b"12345678"]}},
    ],
)
def test_what_is_no_picture_is_a_problem(data: Any) -> None:
    frame = Frame.from_wire(data, SIZE)
    assert frame.picture is None
    assert frame.problem.startswith("the engine drew what is no picture of (48, 36): ")
