"""Honest worlds of engines that are here pass the parity check."""

from __future__ import annotations

from typing import Any

import pytest

from pytest_simbench.simulator.parity import check
from pytest_simbench.simulator.quantities import expected_quantities
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.tasks import Jitter, Stacking, Throwing
from tests.conftest import HERE


@pytest.mark.parametrize("profile", ["default", "tuned"])
@pytest.mark.parametrize("task", [Stacking(), Throwing()], ids=lambda task: task.name)
@pytest.mark.parametrize("name", HERE)
def test_an_honest_world_passes(name: str, task: Any, profile: str) -> None:
    cls = adapter(name)
    simulator = cls(cls.profiles[profile])
    scene = task.scene(7, Jitter())
    simulator.load(scene)
    try:
        expected = expected_quantities(scene, simulator.settings)
        check(expected, simulator.read_back(), cls.info.deviations, cls.info.name)
    finally:
        simulator.close()
