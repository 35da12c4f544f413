"""Motions keep the limits, start and end at rest, and are as straight as they say."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_simbench.motion.panda import LIMITS
from pytest_simbench.motion.timing import TICK, Timed, along_path, straight_move, synchronised_move

joints = st.lists(st.floats(-1.5, 1.5), min_size=7, max_size=7).map(np.array)


def check(timed: Timed) -> None:
    assert (np.abs(timed.velocity) <= LIMITS.column("velocity") * 1.001).all()
    assert (np.abs(timed.acceleration) <= LIMITS.column("acceleration") * 1.001).all()
    for row in (0, -1):
        assert np.abs(timed.velocity[row]).max() < 1e-6
    slope = np.diff(timed.position, axis=0)[:-1] / TICK
    middle = (timed.velocity[:-2] + timed.velocity[1:-1]) / 2
    assert np.allclose(slope, middle, atol=0.03)


@given(joints, joints, st.floats(0.2, 1.0))
@settings(max_examples=60, deadline=None)
def test_straight_move(start: np.ndarray, goal: np.ndarray, speed: float) -> None:
    timed = straight_move(start, goal, LIMITS, speed=speed)
    check(timed)
    assert np.allclose(timed.position[-1], goal, atol=1e-9)
    way = goal - start
    if np.linalg.norm(way) > 1e-3:
        share = (timed.position - start) @ way / (way @ way)
        assert np.abs(timed.position - start - share[:, None] * way).max() < 1e-9


@given(joints, joints)
@settings(max_examples=30, deadline=None)
def test_synchronised_move(start: np.ndarray, goal: np.ndarray) -> None:
    timed, duration = synchronised_move(start, goal, LIMITS)
    check(timed)
    assert np.allclose(timed.position[-1], goal, atol=1e-6)
    assert duration <= timed.duration < duration + TICK + 1e-9


def test_half_speed_takes_twice_as_long() -> None:
    start, goal = np.zeros(7), np.full(7, 1.0)
    full, half = (straight_move(start, goal, LIMITS, speed=speed).duration for speed in (1.0, 0.5))
    assert abs(half - 2 * full) <= 2 * TICK


def test_along_a_curved_path() -> None:
    s = np.linspace(0.0, 1.0, 20)[:, None]
    path = 0.5 * np.hstack([np.sin(s * k) for k in range(1, 8)])
    timed = along_path(path, LIMITS)
    check(timed)
    assert np.allclose(timed.position[-1], path[-1], atol=1e-6)
