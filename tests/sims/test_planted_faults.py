"""Parity of engines in interpreters of their own: honest worlds pass, planted faults do not.

Their faults are planted in the worker, by an adapter whose settings name the quantity.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import pytest

from pytest_simbench.client.errors import WorldParityError
from pytest_simbench.simulator import Simulator
from pytest_simbench.simulator.parity import compare
from pytest_simbench.simulator.quantities import expected_quantities
from pytest_simbench.tasks import Jitter, Stacking, Throwing

from . import genesis_faults, newton_faults, ode_faults
from .coverage import uncovered
from .worlds import Worlds

SCENE = Stacking().scene(1, Jitter())
ENGINES: dict[str, tuple[type[Simulator], Any]] = {
    "newton": (newton_faults.FaultyNewton, newton_faults.FAULTS),
    "genesis": (genesis_faults.FaultyGenesis, genesis_faults.FAULTS),
    "ode": (ode_faults.FaultyODE, ode_faults.FAULTS),
}
HONEST = [
    ("newton", "default"),
    ("newton", "tuned"),
    ("genesis", "tuned"),
    ("ode", "default"),
    ("ode", "tuned"),
]


@pytest.fixture(scope="module")
def kept() -> Iterator[dict[str, Worlds]]:
    """One worker for each engine, whatever the order of the tests: Genesis compiles for 20 s."""
    with ExitStack() as stack:
        kept: dict[str, Worlds] = {}
        yield kept
        for worlds in kept.values():
            stack.enter_context(worlds)


@pytest.fixture
def worlds(request: pytest.FixtureRequest, kept: dict[str, Worlds]) -> Worlds:
    name = request.param
    if name not in kept:
        kept[name] = Worlds(ENGINES[name][0])
    return kept[name]


@pytest.mark.parametrize(("worlds", "profile"), HONEST, indirect=["worlds"])
@pytest.mark.parametrize("task", [Stacking(), Throwing()], ids=lambda task: task.name)
def test_an_honest_world_passes(worlds: Worlds, task: Any, profile: str) -> None:
    assert worlds.load(task.scene(7, Jitter()), profile).time == 0.0


@pytest.mark.parametrize(
    ("worlds", "quantity"),
    [(name, quantity) for name, (_, faults) in ENGINES.items() for quantity in faults],
    indirect=["worlds"],
)
def test_fault_is_caught(worlds: Worlds, quantity: str) -> None:
    world, cls = worlds.load(SCENE, parity=False, fault=quantity), worlds.cls
    expected = expected_quantities(SCENE, cls.profiles["tuned"])
    reported = world.process.request("read_back")
    wrong = compare(expected, reported, cls.info.deviations, cls.info.name).wrong
    assert re.match(f"scene .*, {cls.info.name} ", wrong[quantity])


@pytest.mark.parametrize("worlds", ENGINES, indirect=True)
def test_a_fault_ends_the_loading(worlds: Worlds) -> None:
    with pytest.raises(WorldParityError, match=f"gravity: scene .*, {worlds.cls.info.name} "):
        worlds.load(SCENE, fault="gravity")


@pytest.mark.parametrize("worlds", ENGINES, indirect=True)
def test_nothing_is_left_out(worlds: Worlds) -> None:
    reported = worlds.load(SCENE).process.request("read_back")
    assert uncovered(reported, ENGINES[worlds.cls.info.name][1]) == set()
