"""Flights cut out of samples made by hand."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from pytest_simbench.sims.mujoco.adapter import MuJoCo

from pytest_simbench.client.world import World
from pytest_simbench.robot.throw import swing_of
from pytest_simbench.scene import Scene
from pytest_simbench.tasks import Jitter, Throwing
from pytest_simbench.tasks.manipulator import Manipulator
from pytest_simbench.tasks.throw_analysis import (
    OUT_OF_HAND,
    Thrown,
    _apart,
    free_flight,
    may_touch,
    unclenched,
)
from pytest_simbench.testing.drives import close_command
from pytest_simbench.testing.scenes import grip, with_joint
from pytest_simbench.testing.subject import Subject
from tests.testing.cheats import HalfFlight

GRAVITY = np.array([0.0, 0.0, -9.80665])


def flight(release: float, contact: float, share: float = 1.0) -> tuple[Any, ...]:
    """A cube held at first on a swing that accelerates as gravity does, then free, under a share of
    gravity, 2 m/s away from the hand, then hit: arguments of `free_flight` without gravity."""
    time = np.arange(0, 1.0, 0.002)
    velocity = np.array([2.0, 0.0, 1.0]) + share * GRAVITY * time[:, None]
    velocity[time >= contact] = 0.0
    fingers = np.full((len(time), 2), 0.025)
    fingers[time >= release] = 0.026
    apart = (time >= release + OUT_OF_HAND / 2.0) & (release < 1.0)
    return time, velocity, unclenched(fingers), apart, time >= contact - 0.004


def test_flight_begins_when_the_fingers_open_not_before() -> None:
    """And it ends with the step before the contact, though that was near two steps earlier."""
    time, *rows = flight(0.3, 0.6)
    found = free_flight(time, *rows, GRAVITY)
    assert found is not None
    at = [time[k] for k in (found.first, found.clear, found.last)]
    assert at == pytest.approx([0.3, 0.3, 0.598], abs=1e-9)


@pytest.mark.parametrize("share", [0.0, 0.5, 0.8, 1.2, 2.0])
def test_a_flight_under_another_gravity_is_as_long(share: float) -> None:
    """It began when the cube was certainly out of the hand, at the latest."""
    time, *rows = flight(0.3, 0.6, share)
    found = free_flight(time, *rows, GRAVITY)
    assert found is not None
    assert 0.3 - 1e-9 <= time[found.clear] <= 0.3 + OUT_OF_HAND / 2.0 + 0.002
    assert time[found.last] > 0.59


def test_a_finger_that_touches_a_flying_cube_again_is_of_the_hand() -> None:
    time, velocity, *rows = flight(0.3, 0.6)
    velocity[time >= 0.31] += [0.1, 0.0, 0.0]
    found = free_flight(time, velocity, *rows, GRAVITY)
    assert found is not None
    assert [time[k] for k in (found.first, found.clear)] == pytest.approx([0.3, 0.31], abs=1e-9)


def test_no_flight_when_the_cube_stays_in_the_hand() -> None:
    assert free_flight(*flight(9.0, 9.0), GRAVITY) is None


@dataclass(frozen=True)
class Held(Throwing):
    """The throw alone: the hand has the cube."""

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        robot, (start, _) = self.arm, swing_of(self.arm)
        for joint, value in zip(robot.arm_joints, start, strict=True):
            robot = with_joint(robot, joint.name, initial_position=float(value))
        held = replace(grip(robot).body("held"), name="projectile")
        return replace(super().scene(seed, jitter), robot=robot).with_body(held)

    def thrown(self, world: World) -> Thrown:
        world.follow(close_command(world.scene, 0.004))
        world.wait(0.3)
        return self._throw(Manipulator(world, np.random.default_rng(0)))


def test_half_gravity_in_flight_is_no_small_error() -> None:
    """What an engine makes of the flight shows, though the cheat begins with the flight."""
    task, found = Held(), {}
    for adapter in (MuJoCo, HalfFlight):
        with Subject(adapter).world(task.scene(1, Jitter())) as world:
            found[adapter] = task.thrown(world).metrics()["flight_error"]
    assert found[MuJoCo] == pytest.approx(0.0013, abs=2e-4)
    assert found[HalfFlight] is not None
    assert found[HalfFlight] > 0.1


def test_a_cube_may_touch_what_is_near_and_the_ground() -> None:
    """The nearer face, a turned cube's corner, and what a fast cube reaches within a step."""
    level = [1.0, 0.0, 0.0, 0.0]
    far = [0.0, 0.0, 5.0, *level]
    on_edge = [math.cos(math.pi / 8), math.sin(math.pi / 8), 0.0, 0.0]  # 35.4 mm high
    cases = [
        ([0.054, 0.0, 1.0, *level], True), ([0.056, 0.0, 1.0, *level], False),
        ([9.0, 0.0, 0.029, *level], True), ([9.0, 0.0, 0.031, *level], False),
        ([9.0, 0.0, 0.040, *on_edge], True), ([9.0, 0.0, 0.041, *on_edge], False),
    ]  # fmt: skip
    other = [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0]
    for own, touches in cases:
        poses = np.array([[other, own, far]] * 2)
        assert may_touch(poses, 1, 0.05).tolist() == [touches] * 2
    fast = np.array([[other, [0.2, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0]],
                     [other, [0.12, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0]]])  # fmt: skip
    assert may_touch(fast, 1, 0.05).tolist() == [False, True]


def test_one_finger_still_presses() -> None:
    fingers = np.array([[0.025, 0.025], [0.03, 0.0253], [0.026, 0.026], [0.0254, 0.0254]])
    assert unclenched(fingers).tolist() == [False, False, True, False]


@pytest.mark.parametrize(("off", "flies"), [(1.9, True), (2.1, False)])
def test_air_may_brake_but_little(off: float, flies: bool) -> None:
    time = np.arange(0, 0.5, 0.002)
    gone, never = np.ones(len(time), bool), np.zeros(len(time), bool)
    velocity = np.array([off, 0.0, GRAVITY[2]]) * time[:, None]
    assert (free_flight(time, velocity, gone, never, never, GRAVITY) is not None) == flies


def test_two_samples_are_no_flight() -> None:
    time = np.array([0.0, 0.1])
    rows = np.array([[0.0, 0, 0], 0.1 * GRAVITY])
    assert free_flight(time, rows, *np.ones((3, 2), bool), GRAVITY) is None
    assert math.isclose(rows[1, 2], -0.980665)


@pytest.mark.parametrize(
    ("a", "b", "apart"), [(1.2, 1.5, 0.3), (None, 1.5, None), (1.2, None, None), (None, None, None)]
)
def test_a_flight_that_lands_nowhere_is_no_distance_from_another(
    a: float | None, b: float | None, apart: float | None
) -> None:
    assert _apart(a, b) == (apart if apart is None else pytest.approx(apart))
