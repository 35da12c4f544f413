"""Flights cut out of samples made by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pytest_simbench.scene import FloatArray
from pytest_simbench.tasks.throw_analysis import _apart, free_flight, unclenched

GRAVITY = np.array([0.0, 0.0, -9.80665])


def flight(release: float, contact: float) -> tuple[FloatArray, ...]:
    """A cube held at first on a swing that accelerates as gravity does, then free, then hit."""
    time = np.arange(0, 1.0, 0.002)
    velocity = np.array([2.0, 0.0, 1.0]) + GRAVITY * time[:, None]
    velocity[time >= contact] = 0.0
    fingers = np.full((len(time), 2), 0.025)
    fingers[time >= release] = 0.026
    return time, velocity, fingers


def test_flight_begins_when_the_fingers_open_not_before() -> None:
    time, velocity, fingers = flight(0.3, 0.6)
    found = free_flight(time, velocity, unclenched(fingers), GRAVITY)
    assert found is not None
    assert time[found.first] == pytest.approx(0.3, abs=1e-9)
    assert time[found.last] == pytest.approx(0.598, abs=1e-9)


def test_no_flight_when_the_cube_stays_in_the_hand() -> None:
    time, velocity, fingers = flight(9.0, 9.0)
    assert free_flight(time, velocity, unclenched(fingers), GRAVITY) is None


def test_one_finger_still_presses() -> None:
    fingers = np.array([[0.025, 0.025], [0.03, 0.0253], [0.026, 0.026], [0.0254, 0.0254]])
    assert unclenched(fingers).tolist() == [False, False, True, False]


@pytest.mark.parametrize(("off", "flies"), [(1.9, True), (2.1, False)])
def test_air_may_brake_but_little(off: float, flies: bool) -> None:
    time = np.arange(0, 0.5, 0.002)
    gone = np.ones(len(time), bool)
    velocity = np.array([off, 0.0, GRAVITY[2]]) * time[:, None]
    assert (free_flight(time, velocity, gone, GRAVITY) is not None) == flies


def test_two_samples_are_no_flight() -> None:
    time = np.array([0.0, 0.1])
    rows = np.array([[0.0, 0, 0], 0.1 * GRAVITY])
    assert free_flight(time, rows, np.ones(2, bool), GRAVITY) is None
    assert math.isclose(rows[1, 2], -0.980665)


@pytest.mark.parametrize(
    ("a", "b", "apart"), [(1.2, 1.5, 0.3), (None, 1.5, None), (1.2, None, None), (None, None, None)]
)
def test_a_flight_that_lands_nowhere_is_no_distance_from_another(
    a: float | None, b: float | None, apart: float | None
) -> None:
    assert _apart(a, b) == (apart if apart is None else pytest.approx(apart))
