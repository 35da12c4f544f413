"""What only Genesis' adapter has to show, in its own interpreter: parity, drives, reloading.

Worlds are dear (about a second of CPU each, ten for a process), so one worker serves all tests
that can share it.
"""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from pytest_simbench.sims.genesis.adapter import Genesis
from pytest_simbench.sims.genesis.engine import quick_inspection

from pytest_simbench.client.environments import Environment, interpreter, missing
from pytest_simbench.client.errors import EngineFailed, Where, WorldParityError
from pytest_simbench.client.process import Launch, WorkerProcess
from pytest_simbench.client.world import World
from pytest_simbench.scene import FloatArray, Scene, Trajectory
from pytest_simbench.simulator.parity import compare
from pytest_simbench.simulator.quantities import expected_quantities
from pytest_simbench.tasks import Jitter, Stacking, Throwing
from pytest_simbench.testing import scenes
from tests.sims.coverage import uncovered
from tests.sims.genesis_faults import FAULTS

ADAPTER = "tests.sims.genesis_faults:FaultyGenesis"


@pytest.fixture(scope="module")
def worker() -> Iterator[WorkerProcess]:
    absent = missing(Genesis.info)
    if absent:
        pytest.skip(absent)
    process = WorkerProcess(
        Launch(
            ADAPTER,
            python=interpreter(Genesis.info),
            environment=Environment.of(Genesis.info).variables(),
            stall_timeout=120.0,
            compile_timeout=Genesis.info.compile_timeout,
        ),
        Where("genesis", "headless"),
    )
    yield process
    process.close()


def load(
    worker: WorkerProcess,
    scene: Scene,
    profile: str = "tuned",
    parity: bool = True,
    **changes: Any,
) -> World:
    worker.request(
        "construct",
        timeout=120.0,
        adapter=ADAPTER,
        profile=profile,
        changes=changes,
        gui=False,
        real_time=False,
    )
    return World(worker, scene, parity=parity)


@pytest.mark.parametrize("task", [Stacking(), Throwing()], ids=lambda task: task.name)
def test_an_honest_world_passes(worker: WorkerProcess, task: Any) -> None:
    assert load(worker, task.scene(7, Jitter())).time == 0.0


@pytest.mark.parametrize("quantity", FAULTS)
def test_fault_is_caught(worker: WorkerProcess, quantity: str) -> None:
    scene = Stacking().scene(1, Jitter())
    world = load(worker, scene, parity=False, fault=quantity)
    expected = expected_quantities(scene, Genesis.profiles["tuned"])
    reported = world.process.request("read_back")
    wrong = compare(expected, reported, Genesis.info.deviations, "genesis").wrong
    assert re.match("scene .*, genesis ", wrong[quantity])


def test_a_fault_ends_the_loading(worker: WorkerProcess) -> None:
    with pytest.raises(WorldParityError, match="gravity: scene .*, genesis "):
        load(worker, Stacking().scene(1, Jitter()), fault="gravity")


def test_nothing_is_left_out(worker: WorkerProcess) -> None:
    world = load(worker, Stacking().scene(1, Jitter()))
    assert uncovered(world.process.request("read_back"), FAULTS) == set()


def held(position: FloatArray, effort: FloatArray, timestep: float) -> Trajectory:
    rest = np.zeros_like(position)
    return Trajectory(timestep, *(np.array([row, row]) for row in (position, rest, effort)))


def test_the_limit_bounds_drive_and_feed_forward_together(worker: WorkerProcess) -> None:
    """An effort of 3000 N m asked for as feed-forward moves joint 1 just as a far position does:
    both are cut to 87 N m (for so short a time that the damping does not leave the limit)."""
    robot, timestep = scenes.arm(), Genesis.profiles["tuned"].timestep
    start, effort = robot.column("initial_position"), np.zeros(9)
    far = start.copy()
    far[0] += 2.0
    effort[0] = 3000.0
    speeds = []
    for command in (held(far, 0 * effort, timestep), held(start, effort, timestep)):
        world = load(worker, scenes.arm_alone(robot, (0.0, 0.0, 0.0), "weightless"))
        world.follow(command)
        world.wait(0.02)
        speeds.append(world.joints[1, 0])
    assert speeds[0] > 0.3
    assert speeds[1] == pytest.approx(speeds[0], rel=0.01)


def test_a_world_does_not_remember_the_one_before(worker: WorkerProcess) -> None:
    """Kernels stay in the process between worlds; nothing else does."""
    ends = []
    for _ in range(2):
        world = load(worker, scenes.grip())
        world.wait(0.1)
        ends.append((world.bodies.tobytes(), world.joints.tobytes()))
        load(worker, scenes.tower()).wait(0.1)
    assert ends[0] == ends[1]


def test_the_worker_survives_a_bad_option(worker: WorkerProcess) -> None:
    """The engine refuses the elliptic cone with noslip; the next world loads as if nothing was."""
    with pytest.raises(EngineFailed, match="elliptic"):
        load(worker, scenes.tower(), friction_cone="elliptic", noslip_iterations=5)
    assert load(worker, scenes.tower()).time == 0.0


def test_import_is_spared_only_what_finds_nothing() -> None:
    """For frames of Python's import system the answer is None, as it would be after a search; for
    all else it is `inspect`'s own, which is back in its place even after an error."""
    original = inspect.getmodule
    code = compile("import sys; frame = sys._getframe()", "<frozen importlib._bootstrap>", "exec")
    names: dict[str, Any] = {}
    exec(code, names)
    here = sys._getframe()

    def look_around_and_fail() -> None:
        with quick_inspection():
            assert inspect.getmodule is not original
            assert inspect.getmodule(names["frame"]) is None
            assert inspect.getmodule(here) is sys.modules[__name__]
            assert inspect.getmodule(Scene) is sys.modules[Scene.__module__]
            raise KeyError("planned")

    with pytest.raises(KeyError, match="planned"):
        look_around_and_fail()
    assert inspect.getmodule is original
    assert inspect.getmodule(names["frame"]) is None
