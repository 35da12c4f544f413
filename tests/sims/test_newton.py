"""Newton's parity check, in Newton's own interpreter: honest worlds pass, planted faults do not."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pytest
from pytest_simbench.sims.newton.adapter import Newton

from pytest_simbench.client.environments import Environment, interpreter, missing
from pytest_simbench.client.errors import Where, WorldParityError
from pytest_simbench.client.process import Launch, WorkerProcess
from pytest_simbench.client.world import World
from pytest_simbench.scene import Scene
from pytest_simbench.simulator.parity import compare
from pytest_simbench.simulator.quantities import expected_quantities
from pytest_simbench.tasks import Jitter, Stacking, Throwing
from tests.sims.coverage import uncovered
from tests.sims.newton_faults import FAULTS

ADAPTER = "tests.sims.newton_faults:FaultyNewton"


@pytest.fixture(scope="module")
def worker() -> Iterator[WorkerProcess]:
    absent = missing(Newton.info)
    if absent:
        pytest.skip(absent)
    process = WorkerProcess(
        Launch(
            ADAPTER,
            python=interpreter(Newton.info),
            environment=Environment.of(Newton.info).variables(),
            stall_timeout=120.0,
            compile_timeout=Newton.info.compile_timeout,
        ),
        Where("newton", "headless"),
    )
    yield process
    process.close()


def load(
    worker: WorkerProcess,
    scene: Scene,
    profile: str = "tuned",
    fault: str = "",
    parity: bool = True,
) -> World:
    worker.request(
        "construct",
        adapter=ADAPTER,
        profile=profile,
        changes={"fault": fault},
        gui=False,
        real_time=False,
    )
    return World(worker, scene, parity=parity)


@pytest.mark.parametrize("profile", ["default", "tuned"])
@pytest.mark.parametrize("task", [Stacking(), Throwing()], ids=lambda task: task.name)
def test_an_honest_world_passes(worker: WorkerProcess, task: Any, profile: str) -> None:
    assert load(worker, task.scene(7, Jitter()), profile).time == 0.0


@pytest.mark.parametrize("quantity", FAULTS)
def test_fault_is_caught(worker: WorkerProcess, quantity: str) -> None:
    scene = Stacking().scene(1, Jitter())
    world = load(worker, scene, parity=False, fault=quantity)
    expected = expected_quantities(scene, Newton.profiles["tuned"])
    reported = world.process.request("read_back")
    wrong = compare(expected, reported, Newton.info.deviations, "newton").wrong
    assert re.match("scene .*, newton ", wrong[quantity])


def test_a_fault_ends_the_loading(worker: WorkerProcess) -> None:
    with pytest.raises(WorldParityError, match="gravity: scene .*, newton "):
        load(worker, Stacking().scene(1, Jitter()), fault="gravity")


def test_nothing_is_left_out(worker: WorkerProcess) -> None:
    world = load(worker, Stacking().scene(1, Jitter()))
    assert uncovered(world.process.request("read_back"), FAULTS) == set()
