"""What the engines claim: determinism, restore in flight and in the grip, pictures, contacts."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from pytest_simbench.client.errors import Where
from pytest_simbench.client.process import WorkerProcess
from pytest_simbench.client.world import World
from pytest_simbench.experiment.case import Case
from pytest_simbench.scene import FloatArray, Scene
from pytest_simbench.simulator import Capability
from pytest_simbench.tasks import Jitter, Throwing
from pytest_simbench.tasks.manipulator import Manipulator
from tests.conftest import ADAPTERS, able_to, case_of

SCENE = Throwing().scene(1, Jitter())


@pytest.fixture(params=ADAPTERS)
def start(request: pytest.FixtureRequest, case: Case) -> Iterator[Callable[[Scene], World]]:
    """Starts worlds of an engine, each in a process of its own."""
    workers = []
    engine = case_of(case, request.param)

    def begin(scene: Scene) -> World:
        worker = WorkerProcess(engine.launch("engine"), Where(engine.simulator, "headless"))
        workers.append(worker)
        worker.construct()
        return World(worker, scene)

    yield begin
    for worker in workers:
        worker.close()


def grasped(world: World) -> Manipulator:
    manipulator = Manipulator(world, np.random.default_rng(0))
    manipulator.pick("projectile")
    return manipulator


def test_two_processes_agree_bit_for_bit(start: Callable[[Scene], World]) -> None:
    def end() -> tuple[FloatArray, FloatArray]:
        world = start(SCENE)
        grasped(world)
        return world.bodies, world.joints

    first, second = end(), end()
    assert np.array_equal(first[0], second[0])
    assert np.array_equal(first[1], second[1])


@pytest.mark.parametrize("start", able_to(Capability.SAVE_RESTORE), indirect=True)
def test_restore_in_the_grip_repeats_itself(start: Callable[[Scene], World]) -> None:
    world = start(SCENE)
    manipulator = grasped(world)
    world.save()
    lift = manipulator.planner.move_fingers(manipulator.arm, 0.0, 0.035, 0.3)
    ends = []
    for _ in range(2):
        world.restore()
        world.follow(lift)
        ends.append((world.bodies.copy(), world.joints.copy()))
    assert np.array_equal(ends[0][0], ends[1][0])
    assert np.array_equal(ends[0][1], ends[1][1])


@pytest.mark.parametrize("start", able_to(Capability.OFFSCREEN), indirect=True)
def test_picture(start: Callable[[Scene], World]) -> None:
    world = start(SCENE)
    world.wait(0.1)
    picture = world.render(160, 120)
    assert picture.shape == (120, 160, 3)
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 20


@pytest.mark.parametrize("start", able_to(Capability.CONTACT_COUNT), indirect=True)
def test_contacts(start: Callable[[Scene], World]) -> None:
    world = start(SCENE)
    world.wait(0.1)
    assert world.contact_count() >= 7 * 3
