"""Whose doing a motion was, on logs made by hand: cubes of 5 cm on one line, seen from above."""

from __future__ import annotations

import numpy as np
import pytest

from pytest_simbench.scene import FloatArray
from pytest_simbench.tasks.throw_analysis import impact

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


def test_what_it_hits_it_moved() -> None:
    assert caused(THROWN, going(1.0, 1.0, 0.475, 0.6)) == (0,)


def test_what_stays_it_did_not() -> None:
    assert caused(THROWN, still(1.0)) == ()


@pytest.mark.parametrize("early", [0.06, 0.2, 0.4])
def test_what_moved_before_it_came_it_did_not_move(early: float) -> None:
    start = 0.475 - early
    assert caused(THROWN, going(1.0, 0.5, start, start + 0.1)) == ()


def test_what_moves_long_after_it_came_to_rest_it_did_not_move() -> None:
    """Though it lies against it."""
    assert caused(THROWN, going(1.0, 1.0, 2.0, 2.1)) == ()


def test_what_moves_elsewhere_at_that_time_it_did_not_move() -> None:
    aside = going(1.0, 1.0, 0.475, 0.6, y=0.2)
    assert caused(THROWN, going(1.0, 1.0, 0.475, 0.6), aside) == (0,)
    assert caused(THROWN, aside) == ()


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


def test_two_that_begin_in_the_same_sample() -> None:
    """The farther one, which the thrown cube does not reach, leans on the nearer one."""
    near, far = (going(x, 1.0, 0.475, 0.6) for x in (1.0, 1.05))
    assert caused(THROWN, near, far) == (0, 1)
    assert caused(THROWN, far, near) == (1, 0)


def test_a_chain_has_a_direction() -> None:
    """0 leaves 1 by itself, which the thrown cube hits later."""
    first = going(1.051, 1.0, 0.2, 0.3)
    assert caused(THROWN, first, going(1.0, 1.0, 0.475, 0.52)) == (1,)


def test_a_cube_in_the_hand_throws_nothing() -> None:
    hit = going(1.0, 1.0, 0.475, 0.6)
    assert caused(THROWN, hit, free=len(TIME)) == ()
    assert caused(THROWN, hit, free=round(0.6 / STEP)) == ()
    assert caused(THROWN, hit, free=round(0.4 / STEP)) == (0,)


def test_a_turned_cube_reaches_farther() -> None:
    """By 45 degrees about the vertical a corner stands out 10 mm beyond the face."""
    hit = going(1.0, 1.0, 0.475, 0.6)
    short = going(-0.015, 2.0, 0.0, 0.475)  # stops 15 mm before it
    assert caused(short, hit) == ()
    turned = short.copy()
    turned[:, 3:] = [np.cos(np.pi / 8), 0.0, 0.0, np.sin(np.pi / 8)]
    assert caused(turned, hit) == (0,)


def test_creep_is_no_motion() -> None:
    assert caused(THROWN, going(1.0, 0.03, 0.475, 4.0)) == ()


def test_a_fast_cube_touches_between_samples() -> None:
    """At 5 m/s and 50 ms it is seen 20 cm before the cube, and back again."""
    time = 0.05 * np.arange(40)
    thrown, hit = (np.tile([0.0, 0, 0.025, 1, 0, 0, 0], (40, 1)) for _ in range(2))
    thrown[:, 0] = np.where(time < 0.175, 5.0 * time, 0.75 - 1.0 * (time - 0.175))
    hit[:, 0] = 1.0 + np.clip(time - 0.18, 0.0, 0.3)
    assert impact(time, thrown, hit[:, None], EDGE, 0).caused == (0,)


def test_the_throws_motion_ends_when_all_is_calm() -> None:
    """Half a second after the last cube stopped; what falls later is not the throw's."""
    hit = going(1.0, 1.0, 0.475, 0.6)
    late = going(2.0, 1.0, 2.0, 2.2)
    found = impact(TIME, THROWN, np.stack([hit, late], axis=1), EDGE, 0)
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


def test_nothing_thrown_nothing_caused() -> None:
    found = impact(TIME, still(0.0), still(1.0)[:, None], EDGE, len(TIME))
    assert found.caused == ()
