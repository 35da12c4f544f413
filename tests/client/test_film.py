"""Pictures along the way: evenly spaced in simulated time, and nothing else is different."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pytest_simbench.client.errors import Where
from pytest_simbench.client.frame import Frame
from pytest_simbench.client.process import WorkerProcess
from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.scene import Pose, Scene
from pytest_simbench.tasks.base import cube

SCENE = Scene("s", (cube("a", Pose.at(0.0, 0.0, 2.0), (1.0,) * 4),))
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
