"""The parity check catches a world that differs from the scene, on real engines."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from pytest_simbench.simulator import ParityError, Simulator
from pytest_simbench.simulator.parity import check
from pytest_simbench.simulator.quantities import expected_quantities
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.tasks import Jitter, Stacking
from tests.conftest import HERE

SCENE = Stacking().scene(1, Jitter())


@pytest.fixture(params=HERE)
def loaded(request: pytest.FixtureRequest) -> Iterator[Simulator]:
    cls = adapter(request.param)
    simulator = cls(cls.profiles["tuned"])
    simulator.load(SCENE)
    yield simulator
    simulator.close()


def test_what_is_not_reported_must_be_declared(loaded: Simulator) -> None:
    reported = loaded.read_back()
    del reported["gravity"]
    expected = expected_quantities(SCENE, loaded.settings)
    with pytest.raises(ParityError, match="gravity: .* reports nothing"):
        check(expected, reported, loaded.info.deviations, loaded.info.name)


def test_a_fallen_cube_is_a_difference(loaded: Simulator) -> None:
    reported = loaded.read_back()
    pose = np.array(reported["body/cube_05/pose"], dtype=float)
    pose[2] += 0.01
    reported["body/cube_05/pose"] = pose
    expected = expected_quantities(SCENE, loaded.settings)
    with pytest.raises(ParityError, match="body/cube_05/pose"):
        check(expected, reported, loaded.info.deviations, loaded.info.name)
