"""SAPIEN's pictures and window: they show what is simulated, and take a Vulkan device."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest
from pytest_simbench.sims.sapien.adapter import SAPIEN

from pytest_simbench.scene import ConvexMesh, Cylinder, FloatArray, Pose, Scene
from pytest_simbench.simulator import UnavailableError
from pytest_simbench.testing import scenes

from .pixels import HEIGHT, RED, WIDTH, pixel, red
from .worlds import loaded

pytest.importorskip("sapien")


@contextmanager
def drawn(scene: Scene) -> Iterator[SAPIEN]:
    """The loaded simulator; skips the test where nothing can be drawn."""
    simulator = loaded(SAPIEN, scene)
    try:
        simulator.render(WIDTH, HEIGHT)
        yield simulator
    except UnavailableError as reason:
        pytest.skip(str(reason))
    finally:
        simulator.close()


def red_at(simulator: SAPIEN, point: FloatArray) -> bool:
    return bool(red(simulator.render(WIDTH, HEIGHT))[pixel(point)])


def test_a_picture_shows_a_falling_cube_where_it_is_also_after_a_restore() -> None:
    cube = replace(scenes.cube("cube", Pose.at(0.5, 0.0, 0.9)), colour=RED)
    with drawn(Scene("falling", bodies=(cube,))) as simulator:
        start = simulator.save()
        high = simulator.body_state()[0, :3]
        assert red_at(simulator, high)
        while simulator.time < 0.3:  # falls by 0.44 m
            simulator.step()
        low = simulator.body_state()[0, :3]
        assert red_at(simulator, low)
        assert not red_at(simulator, high)
        simulator.restore(start)
        assert red_at(simulator, high)
        assert not red_at(simulator, low)


def test_the_robot_is_in_the_picture() -> None:
    with drawn(scenes.arm_alone()) as simulator:
        assert simulator.prepared is not None
        with_arm = simulator.render(WIDTH, HEIGHT).astype(int)
        elbow = simulator._links["panda_link4"].entity.pose.p
    with drawn(Scene("nothing")) as simulator:
        changed = np.abs(with_arm - simulator.render(WIDTH, HEIGHT)).sum(axis=2) > 60
    assert changed[pixel(elbow)]
    assert 0.01 < changed.mean() < 0.5


@pytest.mark.parametrize("shape", ["mesh", "cylinder"])
def test_a_body_of_any_shape_is_in_the_picture(shape: str) -> None:
    place = Pose.at(0.5, 0.0, 0.9)
    corners = tuple((x, y, z) for x in (-0.05, 0.05) for y in (-0.05, 0.05) for z in (-0.05, 0.05))
    body = (
        ConvexMesh("b", corners, place, 0.1, colour=RED)
        if shape == "mesh"
        else Cylinder("b", 0.05, 0.1, place, 0.1, colour=RED)
    )
    with drawn(Scene(shape, bodies=(body,))) as simulator:
        assert red_at(simulator, simulator.body_state()[0, :3])
