"""Scenes have the study's geometry and depend on the seed alone."""

from __future__ import annotations

import hashlib
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_simbench.robot.registry import find
from pytest_simbench.tasks import Jitter, Stacking, Task, Throwing

TASKS = [Stacking(), Throwing()]


@pytest.mark.parametrize("task", TASKS, ids=lambda task: task.name)
@given(seed=st.integers(0, 10_000))
@settings(max_examples=20, deadline=None)
def test_jitter_is_bounded_and_seeded(task: Task, seed: int) -> None:
    jitter = Jitter()
    scene, nominal = task.scene(seed, jitter), task.scene(seed, Jitter(0.0, 0.0))
    assert scene == task.scene(seed, jitter)
    for body, still in zip(scene.free_bodies, nominal.free_bodies, strict=True):
        offset = np.subtract(body.pose.position, still.pose.position)
        assert np.abs(offset[:2]).max() <= jitter.distance
        assert offset[2] == 0
        assert abs(body.pose.yaw - still.pose.yaw) <= jitter.angle + 1e-12


@pytest.mark.parametrize("name", ["panda", "ur5", "ur10", "xarm7"])
@pytest.mark.parametrize(
    ("task", "digest"), [(Stacking(), "c39209f7b4fa93f7"), (Throwing(), "d6760dd99de38895")]
)
def test_arms_of_full_reach_have_the_scene_they_had(task: Task, digest: str, name: str) -> None:
    """To the last bit: digests of November 2026, from before scenes had a scale."""
    bodies = task.on(find(name)).scene(2022, Jitter()).bodies
    told = json.dumps([body.to_wire() for body in bodies], sort_keys=True)
    assert hashlib.sha256(told.encode()).hexdigest()[:16] == digest


@pytest.mark.parametrize("task", TASKS, ids=lambda task: task.name)
def test_a_small_arm_has_a_similar_scene(task: Task) -> None:
    still = Jitter(0.0, 0.0)
    small = task.on(find("so101"))
    assert small.parameters()["task.scale"] == 0.4
    assert small.problem() is None
    pairs = zip(small.scene(0, still).bodies, task.scene(0, still).bodies, strict=True)
    for body, other in pairs:
        assert body.extents == pytest.approx(np.multiply(0.4, other.extents))
        assert body.pose.position == pytest.approx(np.multiply(0.4, other.pose.position))
        assert body.mass == pytest.approx(0.4**3 * other.mass)


def test_repetitions_differ() -> None:
    assert Stacking().scene(1, Jitter()) != Stacking().scene(2, Jitter())


def test_stacking_is_the_studys() -> None:
    scene = Stacking().scene(0, Jitter(0.0, 0.0))
    cubes = scene.free_bodies
    assert len(cubes) == 21
    assert {body.size for body in cubes} == {(0.05, 0.05, 0.05)}
    assert {body.mass for body in cubes} == {0.1}
    assert sorted({round(body.pose.position[0], 9) for body in cubes}) == [0.2, 0.3, 0.4]
    assert sorted({round(body.pose.position[1], 9) for body in cubes}) == [
        -0.3, -0.2, -0.1, 0.0, 0.1, 0.2, 0.3,
    ]  # fmt: skip
    table = scene.body("table")
    assert table.pose.position[2] + table.size[2] / 2 == pytest.approx(0.30)
    heights = [place.pose.position[2] for place in Stacking().places()]
    assert heights[:5] == pytest.approx([0.325, 0.375, 0.425, 0.475, 0.525])
    assert len(heights) == 15


def test_throwing_is_the_studys() -> None:
    scene = Throwing().scene(0, Jitter(0.0, 0.0))
    assert scene.body("projectile").pose.position == (0.5, 0.0, 0.025)
    assert [body.pose.position for body in scene.free_bodies[1:]] == [
        (1.4, -0.065, 0.025), (1.4, 0.0, 0.025), (1.4, 0.065, 0.025),
        (1.4, -0.0335, 0.075), (1.4, 0.0335, 0.075), (1.4, 0.0, 0.125),
    ]  # fmt: skip
