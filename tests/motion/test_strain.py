"""What an executed motion asked of the arm, against motions whose shares are known."""

from __future__ import annotations

import numpy as np
import pytest

from pytest_simbench.motion.model import RobotModel
from pytest_simbench.motion.panda import panda
from pytest_simbench.motion.strain import strain
from pytest_simbench.scene import Box, FloatArray, Pose

MODEL = RobotModel(panda())
GRAVITY = np.array([0.0, 0.0, -9.80665])
STRETCHED = np.array([0.0, np.pi / 2, 0.0, -0.0698, 0.0, 0.0, 0.0, 0.025, 0.025])
"""Straight out to the front, the worst that gravity can do to joint 2."""

ANVIL = Box("anvil", (0.05,) * 3, Pose(), mass=2.0)


def motion(position: FloatArray, velocity: FloatArray) -> FloatArray:
    return np.stack([position, velocity], axis=1)


def still(n: int) -> FloatArray:
    return motion(np.tile(STRETCHED, (n, 1)), np.zeros((n, 9)))


@pytest.mark.parametrize("step", [0.001, 0.002, 0.004])
def test_a_harmonic_swing(step: float) -> None:
    """Joint 1 by 0.5 sin(3 t): speed 1.5 of 2.175 rad/s, acceleration 4.5 of 15 rad/s^2."""
    time = 3.0 + np.arange(0, 2.0, step)
    position, velocity = np.zeros((len(time), 9)), np.zeros((len(time), 9))
    position[:, 0], velocity[:, 0] = 0.5 * np.sin(3 * time), 1.5 * np.cos(3 * time)
    found = strain(MODEL, GRAVITY, time, motion(position, velocity))
    assert found.velocity == pytest.approx(1.5 / 2.175, rel=1e-3)
    assert found.acceleration == pytest.approx(4.5 / 15, rel=1e-3)


def test_each_joint_by_its_own_limits() -> None:
    """Joint 7 at 2 of 2.61 rad/s is less than joint 1 at 2 of 2.175; -2 counts as 2."""
    time = 0.002 * np.arange(50)
    for joint, limit in ((0, 2.175), (6, 2.61)):
        velocity = np.zeros((50, 9))
        velocity[:, joint] = -2.0
        found = strain(MODEL, GRAVITY, time, motion(np.zeros((50, 9)), velocity))
        assert found.velocity == pytest.approx(2.0 / limit)


def test_holding_still_against_gravity() -> None:
    """By hand: the weights of the links and of what is held, times their levers about joint 2."""
    time = 0.002 * np.arange(100)
    empty = strain(MODEL, GRAVITY, time, still(100))
    assert (empty.velocity, empty.acceleration) == (0.0, 0.0)
    pin_model = MODEL.pin
    lever = MODEL.tool_pose(STRETCHED[:7]).position[0]
    held = strain(MODEL, GRAVITY, time, still(100), ANVIL, free=100)
    assert held.torque - empty.torque == pytest.approx(2.0 * 9.80665 * lever / 87.0, rel=1e-6)
    weight = sum(inertia.mass for inertia in pin_model.inertias[2:]) * 9.80665
    assert 0.2 * weight / 87 < empty.torque < 0.6 * weight / 87
    assert held.largest == held.torque


def test_what_is_let_go_is_carried_until_then() -> None:
    time = 0.002 * np.arange(100)
    carried = strain(MODEL, GRAVITY, time, still(100), ANVIL, free=100)
    for free, expected in (
        (100, carried),
        (50, carried),
        (0, strain(MODEL, GRAVITY, time, still(100))),
    ):
        assert strain(MODEL, GRAVITY, time, still(100), ANVIL, free=free) == expected


def test_a_jolt_shows_in_acceleration_and_torque() -> None:
    """Joint 1 gets 0.3 rad/s within 10 ms: 30 rad/s^2, twice its limit."""
    time = 0.001 * np.arange(100)
    velocity = np.zeros((100, 9))
    velocity[:, 0] = 0.3 * np.clip((time - 0.05) / 0.01, 0, 1)
    found = strain(MODEL, GRAVITY, time, motion(np.zeros((100, 9)), velocity))
    assert found.acceleration == pytest.approx(2.0, rel=1e-6)
    mass = MODEL.inverse_dynamics(np.zeros(3), np.zeros((1, 9)), np.zeros((1, 9)), np.eye(9)[:1])[
        0, 0
    ]
    assert found.torque >= 30 * mass / 87 - 1e-6
    assert found.largest == max(found.acceleration, found.torque)


def test_a_jolt_counts_over_10_ms_whatever_the_step() -> None:
    """0.3 rad/s within 2 ms: 30 rad/s^2 over the span, twice the limit."""
    for step in (0.001, 0.002):
        time = step * np.arange(100)
        velocity = np.zeros((100, 9))
        velocity[:, 0] = 0.3 * np.clip((time - 0.05) / 0.002, 0, 1)
        span = 2 * round(0.005 / step) * step
        for began in (0.0, 3.0):
            found = strain(MODEL, GRAVITY, began + time, motion(np.zeros((100, 9)), velocity))
            assert found.acceleration == pytest.approx(0.3 / span / 15, rel=1e-6)


def test_too_short_to_tell() -> None:
    assert strain(MODEL, GRAVITY, np.zeros(1), still(1)) is None
    assert strain(MODEL, GRAVITY, 0.05 * np.arange(2), still(2)) is None
    assert strain(MODEL, GRAVITY, 0.05 * np.arange(3), still(3)) is not None
