"""Every engine draws the same view, of all that is simulated, as it is now."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from pytest_simbench.client.errors import Unavailable
from pytest_simbench.client.world import World
from pytest_simbench.scene import Body, ConvexMesh, Cylinder, FloatArray, Pose, Scene
from pytest_simbench.simulator import Capability
from pytest_simbench.simulator.base import EYE, FIELD_OF_VIEW, view_axes
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.testing import scenes
from tests.conftest import HERE, able_to

from .worlds import Worlds

WIDTH, HEIGHT = 320, 240
RED = (0.9, 0.05, 0.05, 1.0)

PLACES = np.array([[0.0, 0.3, 0.9], [1.3, -0.3, 0.15]])
"""Up left, behind the robot's place; and down right, in front of what is thrown at [m]."""

HIGH = Pose.at(0.5, 0.0, 0.9)
ELBOW = np.array([-0.165, 0.0, 0.615])
"""Where `panda_link4` begins [m]."""


@pytest.fixture(
    scope="module", params=[name for name in HERE if name in able_to(Capability.OFFSCREEN)]
)
def worlds(request: pytest.FixtureRequest) -> Iterator[Worlds]:
    """Skips the test where nothing can be drawn."""
    with Worlds(adapter(request.param)) as worlds:
        try:
            picture(worlds.load(Scene("nothing")))
        except Unavailable as reason:
            pytest.skip(str(reason))
        yield worlds


def pixel(point: FloatArray) -> tuple[int, int]:
    """Row and column of a point in the picture of a pinhole camera at `EYE`, upright."""
    right, down, ahead = view_axes().T
    offset = point - np.array(EYE)
    focal = HEIGHT / 2 / np.tan(FIELD_OF_VIEW / 2)
    x, y = focal * np.array([offset @ right, offset @ down]) / (offset @ ahead)
    return int(HEIGHT / 2 + y), int(WIDTH / 2 + x)


def red(colours: np.ndarray) -> np.ndarray:
    """Which pixels of a picture are red, (height, width)."""
    return colours[:, :, 0] > 2 * colours[:, :, 1:].max(axis=2)


def picture(world: World) -> np.ndarray:
    return world.render(WIDTH, HEIGHT).astype(int)


def red_at(world: World, point: FloatArray) -> bool:
    return bool(red(picture(world))[pixel(point)])


def test_a_cube_is_where_the_shared_camera_sees_it(worlds: Worlds) -> None:
    cubes = tuple(
        replace(scenes.cube(f"cube_{k}", Pose.at(*place)), colour=RED)
        for k, place in enumerate(PLACES)
    )
    seen = red(picture(worlds.load(Scene("cubes", bodies=cubes))))
    left = np.arange(WIDTH) < WIDTH / 2
    for place, half in zip(PLACES, (left, ~left), strict=True):
        rows, columns = np.nonzero(seen & half)
        assert (rows.mean(), columns.mean()) == pytest.approx(pixel(place), abs=3)


def test_a_falling_cube_is_where_it_is_also_after_a_restore(worlds: Worlds) -> None:
    world = worlds.load(Scene("falling", (replace(scenes.cube("cube", HIGH), colour=RED),)))
    world.save()
    high = world.bodies[0, :3].copy()
    assert red_at(world, high)
    world.wait(0.3)  # falls by 0.44 m
    low = world.bodies[0, :3].copy()
    assert (red_at(world, low), red_at(world, high)) == (True, False)
    world.restore()
    assert (red_at(world, low), red_at(world, high)) == (False, True)


def test_the_robot_is_in_the_picture(worlds: Worlds) -> None:
    with_arm, without = (
        picture(worlds.load(scene)) for scene in (scenes.arm_alone(), Scene("nothing"))
    )
    changed = np.abs(with_arm - without).sum(axis=2) > 60
    row, column = pixel(ELBOW)
    assert changed[
        row - 4 : row + 5, column - 4 : column + 5
    ].any()  # one side is as grey as the floor
    assert 0.01 < changed.mean() < 0.5


CORNERS = tuple((x, y, z) for x in (-0.05, 0.05) for y in (-0.05, 0.05) for z in (-0.05, 0.05))


@pytest.mark.parametrize(
    "body",
    [
        ConvexMesh("mesh", CORNERS, HIGH, 0.1, colour=RED),
        Cylinder("cylinder", 0.05, 0.1, HIGH, 0.1, colour=RED),
    ],
    ids=lambda body: body.name,
)
def test_a_body_of_any_shape_is_in_the_picture(worlds: Worlds, body: Body) -> None:
    assert red_at(worlds.load(Scene("one", (body,))), np.array(HIGH.position))
