"""The throw is one that the arm can do, and a perfect follower's landing is the trajectory's."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_simbench.motion.errors import PlanningError
from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.panda import EFFORT_LIMITS, LIMITS, THROW_END, WIND_UP, panda
from pytest_simbench.motion.throw import (
    EFFORT_SHARE,
    SPEED_SHARE,
    feasible_swing,
    landing_x,
    released,
)
from pytest_simbench.motion.timing import TICK, Timed, synchronised_move
from pytest_simbench.scene import Box, FloatArray, Pose

MODEL = RobotModel(panda())
CUBE = Box("cube", (0.05, 0.05, 0.05), Pose(), mass=0.1)
GRAVITY = np.array([0.0, 0.0, -9.80665])
START, GOAL = np.array(WIND_UP), np.array(THROW_END)
VELOCITY, ACCELERATION, JERK = (
    LIMITS.column(what) for what in ("velocity", "acceleration", "jerk")
)


def efforts(timed: Timed) -> FloatArray:
    """Joint torques with the cube in the hand, (n, 7), by Lagrange's equations: mass matrix,
    Coriolis and gravity of a model of its own, not by `RobotModel`."""
    model = pin.buildModelFromUrdf(MODEL.robot.urdf)
    hand = model.frames[model.getFrameId("panda_hand_tcp")]
    inertia = pin.Inertia(0.1, np.zeros(3), 0.1 / 6 * 0.05**2 * np.eye(3))
    model.appendBodyToJoint(hand.parentJoint, inertia, hand.placement)
    model.gravity.linear = GRAVITY
    data = model.createData()
    rows = []
    for arm, rate, change in zip(*timed, strict=True):
        q = np.concatenate([arm, np.full(model.nq - 7, 0.025)])
        v, a = (np.concatenate([part, np.zeros(model.nv - 7)]) for part in (rate, change))
        mass = pin.crba(model, data, q)
        mass = np.triu(mass) + np.triu(mass, 1).T + 0.1 * np.eye(model.nv)  # rotor inertia
        rows.append((mass @ a + pin.nonLinearEffects(model, data, q, v))[:7])
    return np.array(rows)


def test_the_swing_is_feasible_with_margins() -> None:
    timed, duration = feasible_swing(MODEL, START, GOAL, GRAVITY, CUBE)
    assert np.abs(efforts(timed) / EFFORT_LIMITS).max() == pytest.approx(0.90, abs=0.002)
    velocity = np.abs(timed.velocity / VELOCITY).max()
    assert velocity == pytest.approx(0.965, abs=1e-6)
    assert (np.abs(timed.acceleration) <= ACCELERATION).all()
    jerk = np.diff(timed.acceleration, axis=0) / TICK
    assert (np.abs(jerk) <= 0.1001 * JERK).all()
    assert duration <= timed.duration < duration + TICK
    assert np.allclose(timed.position[[0, -1]], [START, GOAL], atol=1e-9)
    assert np.abs(timed.velocity[[0, -1]]).max() < 1e-9


def test_the_studys_swing_is_not() -> None:
    """The audit: 119.5 % of joint 2's 87 N m without the cube; 121.8 with it."""
    timed, duration = synchronised_move(START, GOAL, LIMITS)
    assert duration == pytest.approx(1.464, abs=0.001)
    worst = np.abs(efforts(timed) / EFFORT_LIMITS).max(axis=0)
    assert worst.argmax() == 1
    assert worst[1] == pytest.approx(1.218, abs=0.003)


angles = st.tuples(st.floats(-0.3, 0.3), st.floats(-0.2, 0.2), st.floats(-0.15, 0.0))


@given(angles, angles, st.floats(0.05, 0.5))
@settings(max_examples=25, deadline=None)
def test_any_swing_is_feasible(
    first: tuple[float, ...], last: tuple[float, ...], mass: float
) -> None:
    """From and to places around the throw's, with heavier cubes too."""
    start, goal = START.copy(), GOAL.copy()
    start[[0, 4, 6]] += first
    goal[[0, 4, 6]] += last
    start[1] += first[2] + 0.1
    goal[1] += last[2]
    held = Box("cube", (0.05,) * 3, Pose(), mass=mass)
    timed, _ = feasible_swing(MODEL, start, goal, GRAVITY, held)
    assert np.abs(MODEL.effort_shares(GRAVITY, *timed, held)).max() <= EFFORT_SHARE
    assert np.abs(timed.velocity / VELOCITY).max() <= SPEED_SHARE + 1e-9


def test_a_stronger_arm_swings_faster_and_no_faster_than_its_limits() -> None:
    strong = RobotModel(panda())
    strong.effort_limits = 10 * strong.effort_limits
    timed, duration = feasible_swing(strong, START, GOAL, GRAVITY, CUBE)
    assert duration < feasible_swing(MODEL, START, GOAL, GRAVITY, CUBE)[1]
    assert (np.abs(timed.acceleration) <= ACCELERATION * 1.0001).all()
    assert np.abs(timed.acceleration / ACCELERATION).max() > 0.97


def test_an_arm_too_weak_says_so() -> None:
    anvil = Box("anvil", (0.05,) * 3, Pose(), mass=12.0)
    with pytest.raises(PlanningError, match="too weak to swing what it holds"):
        feasible_swing(MODEL, START, GOAL, GRAVITY, anvil)


def test_the_release_is_a_set_point_of_the_swing() -> None:
    """Position and velocity of the tool there, by differences of positions."""
    timed, duration = feasible_swing(MODEL, START, GOAL, GRAVITY, CUBE)
    for fraction in (0.3, 0.5, 0.61):
        throw = released(MODEL, timed, duration, fraction)
        assert 0 <= throw.time - fraction * duration < TICK
        assert throw.time == pytest.approx(throw.row * TICK)
        tips = np.array(
            [MODEL.tool_pose(timed.position[throw.row + k]).position for k in (-1, 0, 1)]
        )
        assert np.allclose(throw.position, tips[1])
        assert np.allclose(throw.velocity, (tips[2] - tips[0]) / (2 * TICK), atol=2e-3)


def test_the_throw_reaches_the_pyramid() -> None:
    """At its middle height, between 1.35 and 1.40, as published: all scores of throws are held
    against it. The study's throw is a little slower."""
    timed, duration = feasible_swing(MODEL, START, GOAL, GRAVITY, CUBE)
    throw = released(MODEL, timed, duration, 0.5)
    assert np.linalg.norm(throw.velocity) == pytest.approx(2.79, abs=0.005)
    assert duration == pytest.approx(1.640264, abs=1e-5)
    assert throw.landing(GRAVITY) == pytest.approx(1.36671, abs=1e-4)
    small = released(MODEL, timed, duration, 0.5, 0.5)  # lands 25 mm lower, at half a cube there
    fall = (throw.landing(GRAVITY) - throw.position[0]) / throw.velocity[0]
    lower = 0.025 / (9.80665 * fall - throw.velocity[2])  # [s] later, but for what it speeds up
    assert small.landing(GRAVITY) == pytest.approx(1.36671 + lower * throw.velocity[0], abs=1e-3)
    study = released(MODEL, *synchronised_move(START, GOAL, LIMITS), 0.5)
    assert study.landing(GRAVITY) == pytest.approx(1.352, abs=0.001)  # REFERENCE_STUDY
    assert np.allclose(study.velocity, [2.75, 0.0, -0.13], atol=0.04)


def test_what_is_below_and_does_not_rise_never_lands() -> None:
    assert landing_x(np.zeros(3), np.zeros(3), GRAVITY) is None


@given(st.floats(-1, 2), st.floats(0.06, 2), st.floats(-3, 3), st.floats(-3, 3))
def test_landing_is_on_the_parabola_on_the_way_down(
    x: float, z: float, vx: float, vz: float
) -> None:
    sideways = np.array([0.5, 0.0, -9.80665])  # gravity need not be plumb
    landed = landing_x(np.array([x, 0.1, z]), np.array([vx, 1.0, vz]), sideways)
    times = np.roots([-9.80665 / 2, vz, z - 0.05])
    t = float(times.real.max())
    assert landed == pytest.approx(x + vx * t + 0.25 * t * t, abs=1e-9)
