"""Every engine draws the same view: a cube is at the same place in the picture of each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pytest_simbench.client.errors import Unavailable
from pytest_simbench.scene import Pose, Scene
from pytest_simbench.simulator import Capability
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.testing import scenes
from tests.conftest import HERE, able_to

from .pixels import HEIGHT, RED, WIDTH, pixel, red
from .worlds import Worlds

PLACES = np.array([[0.0, 0.3, 0.9], [1.3, -0.3, 0.15]])
"""Up left, behind the robot's place; and down right, in front of what is thrown at [m]."""


@pytest.mark.parametrize("name", [name for name in HERE if name in able_to(Capability.OFFSCREEN)])
def test_a_cube_is_where_the_shared_camera_sees_it(name: str) -> None:
    cubes = tuple(
        replace(scenes.cube(f"cube_{k}", Pose.at(*place)), colour=RED)
        for k, place in enumerate(PLACES)
    )
    with Worlds(adapter(name)) as worlds:
        world = worlds.load(Scene("cubes", bodies=cubes))
        try:
            seen = red(world.render(WIDTH, HEIGHT))
        except Unavailable as reason:
            pytest.skip(str(reason))
    left = np.arange(WIDTH) < WIDTH / 2
    for place, half in zip(PLACES, (left, ~left), strict=True):
        rows, columns = np.nonzero(seen & half)
        assert (rows.mean(), columns.mean()) == pytest.approx(pixel(place), abs=3)
