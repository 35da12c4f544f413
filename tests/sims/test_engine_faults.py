"""Every quantity is read from the engine: each is changed there, behind the adapter's back, and
`read_back` then tells the change.

What a scene can express is changed by the kit (`testing.faults`), in every engine; the rest here,
through each engine's own functions (`ENGINE_faults.py`).
`test_nothing_is_left_out` holds the two lists together against all that the adapter reads back.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from importlib import import_module

import pytest

from pytest_simbench.simulator import Simulator
from pytest_simbench.simulator.parity import compare
from pytest_simbench.simulator.quantities import expected_quantities
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.testing.faults import true_scene
from tests.conftest import HERE

from .coverage import uncovered
from .planted import Plant

SCENE = true_scene()

FAULTS: dict[str, dict[str, Plant]] = {
    name: import_module(f"tests.sims.{name}_faults").FAULTS for name in HERE
}

FIXED_AT_LOAD = {
    "pybullet": {
        "link/*/margin": "changeDynamics leaves the margin of a link's shapes as it is",
        "joint/*/friction": "getJointInfo tells what was loaded, whatever changeDynamics did since",
    },
    "drake": {
        "timestep": "of a plant, which is final",
        "ground/height": "the half space is anchored in the world when the plant is built",
        "body/*/gravity": "a gravity field cannot be changed once the plant is final",
        "link/*/gravity": "a gravity field cannot be changed once the plant is final",
        "body/*/damping": "no floating joint's damping can be set in a context",
    },
}
"""What cannot be changed in an engine once the world stands, by its pattern, and why."""


@pytest.fixture
def loaded(request: pytest.FixtureRequest) -> Iterator[Simulator]:
    cls = adapter(request.param)
    simulator = cls(cls.profiles["tuned"])
    simulator.load(SCENE)
    yield simulator
    simulator.close()


@pytest.mark.parametrize(
    ("loaded", "quantity"),
    [
        pytest.param(name, quantity, id=f"{name}-{quantity}")
        for name in HERE
        for quantity in FAULTS[name]
    ],
    indirect=["loaded"],
)
def test_a_change_in_the_engine_is_told(loaded: Simulator, quantity: str) -> None:
    """Of the quantity before the comma."""
    info, expected = loaded.info, expected_quantities(SCENE, loaded.settings)
    assert not compare(expected, loaded.read_back(), info.deviations, info.name).wrong
    FAULTS[info.name][quantity](loaded)
    wrong = compare(expected, loaded.read_back(), info.deviations, info.name).wrong
    assert re.match(f"scene .*, {info.name} ", wrong[quantity.partition(",")[0]])


@pytest.mark.parametrize("loaded", HERE, indirect=True)
def test_nothing_is_left_out(loaded: Simulator) -> None:
    name = loaded.info.name
    assert uncovered(loaded.read_back(), FAULTS[name], FIXED_AT_LOAD.get(name, {})) == set()
