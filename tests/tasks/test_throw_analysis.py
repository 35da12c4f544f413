"""What became of a thrown cube, and which cubes it moved."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from pytest_simbench.sims.mujoco.adapter import MuJoCo

from pytest_simbench.client.world import World
from pytest_simbench.laws.hands import close_command
from pytest_simbench.motion.throw import swing_of
from pytest_simbench.scene import FloatArray, Scene
from pytest_simbench.tasks import Jitter, Throwing
from pytest_simbench.tasks.manipulator import Manipulator
from pytest_simbench.tasks.throw_analysis import (
    OUT_OF_HAND,
    Thrown,
    _apart,
    free_flight,
    impact,
    may_touch,
    unclenched,
)
from pytest_simbench.testing.scenes import grip
from pytest_simbench.testing.subject import Subject
from tests.tasks.flying import GRAVITY


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
    at = [time[k] for k in (found.first, found.clear, found.last)]
    assert at == pytest.approx([0.3, 0.3, 0.598], abs=1e-9)


@pytest.mark.parametrize("share", [0.0, 0.5, 0.8, 1.2, 2.0])
def test_a_flight_under_another_gravity_is_as_long(share: float) -> None:
    """It began when the cube was certainly out of the hand, at the latest."""
    time, *rows = flight(0.3, 0.6, share)
    found = free_flight(time, *rows, GRAVITY)
    assert 0.3 - 1e-9 <= time[found.clear] <= 0.3 + OUT_OF_HAND / 2.0 + 0.002
    assert time[found.last] > 0.59


def test_a_finger_that_touches_a_flying_cube_again_is_of_the_hand() -> None:
    time, velocity, *rows = flight(0.3, 0.6)
    velocity[time >= 0.31] += [0.1, 0.0, 0.0]
    found = free_flight(time, velocity, *rows, GRAVITY)
    assert [time[k] for k in (found.first, found.clear)] == pytest.approx([0.3, 0.31], abs=1e-9)


def test_no_flight_when_the_cube_stays_in_the_hand() -> None:
    assert free_flight(*flight(9.0, 9.0), GRAVITY) is None


@dataclass(frozen=True)
class Held(Throwing):
    """The throw alone: the hand has the cube."""

    def scene(self, seed: int, jitter: Jitter) -> Scene:
        robot, (start, _) = self.arm, swing_of(self.arm)
        for joint, value in zip(robot.arm_joints, start, strict=True):
            robot = robot.with_joints(joint.name, initial_position=float(value))
        held = replace(grip(robot).body("held"), name="projectile")
        return replace(super().scene(seed, jitter), robot=robot).with_body(held)

    def thrown(self, world: World) -> Thrown:
        world.follow(close_command(world.scene, 0.004))
        world.wait(0.3)
        return self._throw(Manipulator(world, np.random.default_rng(0)))


@pytest.mark.engine
def test_half_gravity_in_flight_is_no_small_error() -> None:
    """What an engine makes of the flight shows, though the cheat begins with the flight."""
    from tests.testing.cheats import HalfFlight  # imports MuJoCo

    task, found = Held(), {}
    for adapter in (MuJoCo, HalfFlight):
        with Subject(adapter).world(task.scene(1, Jitter())) as world:
            found[adapter] = task.thrown(world).metrics()["flight_error"]
    assert found[MuJoCo] == pytest.approx(0.0013, abs=2e-4)
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


@pytest.mark.parametrize(
    ("a", "b", "apart"), [(1.2, 1.5, 0.3), (None, 1.5, None), (1.2, None, None), (None, None, None)]
)
def test_a_flight_that_lands_nowhere_is_no_distance_from_another(
    a: float | None, b: float | None, apart: float | None
) -> None:
    assert _apart(a, b) == (apart if apart is None else pytest.approx(apart))


STEP = 0.004
TIME = STEP * np.arange(1001)
EDGE = 0.05


def still(x: float, y: float = 0.0) -> FloatArray:
    """A cube that lies still, (n, 7)."""
    return np.tile([x, y, 0.025, 1.0, 0.0, 0.0, 0.0], (len(TIME), 1))


def going(x: float, speed: float, start: float, end: float, y: float = 0.0) -> FloatArray:
    """One that moves along x at `speed` [m/s] between two times [s]."""
    rows = still(x, y)
    rows[:, 0] += speed * np.clip(TIME - start, 0.0, end - start)
    return rows


def caused(thrown: FloatArray, *cubes: FloatArray, free: int = 0) -> tuple[int, ...]:
    return impact(TIME, thrown, np.stack(cubes, axis=1), EDGE, free).caused


# flies from x = 0 at 2 m/s and touches the face at 0.975 at t = 0.475: a cube at 1.0
THROWN = going(0.0, 2.0, 0.0, 0.475)


HIT = going(1.0, 1.0, 0.475, 0.6)
ASIDE = going(1.0, 1.0, 0.475, 0.6, y=0.2)
LEANS = going(1.05, 1.0, 0.475, 0.6)


@pytest.mark.parametrize(
    ("cubes", "moved"),
    [
        ([HIT], (0,)),
        ([still(1.0)], ()),
        *(([going(1.0, 0.5, 0.475 - early, 0.575 - early)], ()) for early in (0.06, 0.2, 0.4)),
        ([going(1.0, 1.0, 2.0, 2.1)], ()),  # long after, though it lies against it
        ([HIT, ASIDE], (0,)),
        ([ASIDE], ()),
        ([going(1.0, 0.03, 0.475, 4.0)], ()),  # creep
        ([HIT, LEANS], (0, 1)),  # on the nearer
        ([LEANS, HIT], (1, 0)),
        ([going(1.051, 1.0, 0.2, 0.3), going(1.0, 1.0, 0.475, 0.52)], (1,)),  # 0 left by itself
    ],
)
def test_what_it_moved(cubes: list[FloatArray], moved: tuple[int, ...]) -> None:
    assert caused(THROWN, *cubes) == moved


def test_a_chain() -> None:
    """It hits 0, which hits 1, which hits 2; 3 stands apart and falls meanwhile."""
    row = [
        going(1.0, 1.0, 0.475, 0.575),
        going(1.15, 1.0, 0.575, 0.675),
        going(1.30, 1.0, 0.675, 0.8),
        going(1.6, 1.0, 0.7, 0.8),
    ]
    assert caused(THROWN, *row) == (0, 1, 2)
    assert caused(THROWN, *row[1:]) == ()  # without the first link none


def test_a_cube_in_the_hand_throws_nothing() -> None:
    assert caused(THROWN, HIT, free=len(TIME)) == ()
    assert caused(THROWN, HIT, free=round(0.6 / STEP)) == ()
    assert caused(THROWN, HIT, free=round(0.4 / STEP)) == (0,)


def test_a_turned_cube_reaches_farther() -> None:
    """By 45 degrees about the vertical a corner stands out 10 mm beyond the face."""
    short = going(-0.015, 2.0, 0.0, 0.475)  # stops 15 mm before it
    assert caused(short, HIT) == ()
    turned = short.copy()
    turned[:, 3:] = [np.cos(np.pi / 8), 0.0, 0.0, np.sin(np.pi / 8)]
    assert caused(turned, HIT) == (0,)


def test_a_fast_cube_touches_between_samples() -> None:
    """At 5 m/s and 50 ms it is seen 20 cm before the cube, and back again."""
    time = 0.05 * np.arange(40)
    thrown, hit = (np.tile([0.0, 0, 0.025, 1, 0, 0, 0], (40, 1)) for _ in range(2))
    thrown[:, 0] = np.where(time < 0.175, 5.0 * time, 0.75 - 1.0 * (time - 0.175))
    hit[:, 0] = 1.0 + np.clip(time - 0.18, 0.0, 0.3)
    assert impact(time, thrown, hit[:, None], EDGE, 0).caused == (0,)


def test_the_throws_motion_ends_when_all_is_calm() -> None:
    """Half a second after the last cube stopped; what falls later is not the throw's."""
    late = going(2.0, 1.0, 2.0, 2.2)
    found = impact(TIME, THROWN, np.stack([HIT, late], axis=1), EDGE, 0)
    assert found.caused == (0,)
    # it stopped at 0.6 s, which the window of 50 ms sees out
    assert TIME[found.rest] == pytest.approx(0.6 + 0.05 + 0.5, abs=0.01)


def test_a_calm_before_the_hit_ends_nothing() -> None:
    """It rolls a little, lies for 0.8 s, and flies."""
    hit = going(1.0, 1.0, 1.475, 1.6)
    flown = going(-0.1, 0.5, 0.0, 0.2) + going(0.0, 2.0, 1.0, 1.475) - still(0.0)
    flown[:, 2:] = still(0.0)[:, 2:]
    found = impact(TIME, flown, hit[:, None], EDGE, 0)
    assert found.caused == (0,)
    assert TIME[found.rest] == pytest.approx(1.6 + 0.05 + 0.5, abs=0.01)


def test_motion_that_never_ends() -> None:
    found = impact(TIME, THROWN, going(1.0, 0.5, 0.475, 9.0)[:, None], EDGE, 0)
    assert found.caused == (0,)
    assert found.rest == len(TIME) - 1
