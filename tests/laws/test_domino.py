"""The wave of dominoes that the law expects, against another way to compute it: all plates as
bodies of their own, with the forces between them."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pytest_simbench.laws import domino
from pytest_simbench.laws.base import GRAVITY
from pytest_simbench.laws.domino import HEIGHT, INERTIA, MASS, PITCH, START, THICKNESS
from pytest_simbench.scene import FloatArray

PLATES = 8
NEAR = 1e-4
"""Step of differences [rad, and s times rad/s]."""


def turned(lean: float, x: float, z: float) -> FloatArray:
    """A vector of an upright plate, once it leans forward (x ahead, z up)."""
    sine, cosine = math.sin(lean), math.cos(lean)
    return np.array([cosine * x + sine * z, cosine * z - sine * x])


def gap(behind: float, ahead: float) -> float:
    """From the leading upper edge of a plate to the back of the next one [m]."""
    edge = turned(behind, THICKNESS / 2, HEIGHT) - [PITCH, 0.0]
    return float(-THICKNESS / 2 - edge @ turned(ahead, 1.0, 0.0))


def gaps(leans: FloatArray) -> FloatArray:
    return np.array([gap(a, b) for a, b in pairwise(leans)])


def gradient(leans: FloatArray) -> FloatArray:
    """How the gaps change with the leans, (n - 1, n)."""
    steps = NEAR * np.eye(len(leans))
    return np.array([(gaps(leans + s) - gaps(leans - s)) / (2 * NEAR) for s in steps]).T


def solve(right: FloatArray, leans: FloatArray, rates: FloatArray) -> tuple[FloatArray, FloatArray]:
    """What moves, and by which pushes, such that INERTIA moved = right + pushes' moments, and the
    gaps change by `rates`."""
    slopes, n = gradient(leans), len(leans)
    matrix = np.block([[INERTIA * np.eye(n), -slopes.T], [slopes, np.zeros((n - 1, n - 1))]])
    found = np.linalg.solve(matrix, np.concatenate([right, rates]))
    return found[:n], found[n:]


def forces(leans: FloatArray, speeds: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Accelerations [rad/s^2] and forces between plates that stay together [N]."""
    ahead, back = gaps(leans + NEAR * speeds), gaps(leans - NEAR * speeds)
    bend = (ahead - 2 * gaps(leans) + back) / NEAR**2
    return solve(MASS * GRAVITY * HEIGHT / 2 * np.sin(leans), leans, -bend)


def energy(leans: FloatArray, speeds: FloatArray) -> float:
    high = MASS * GRAVITY * HEIGHT / 2 * float(np.cos(leans).sum())
    return high + INERTIA / 2 * float(speeds @ speeds)


class Row:
    """A row that falls; `least` is the smallest push and force between two plates."""

    def __init__(self) -> None:
        self.times: list[float] = []
        self.least_force = self.least_impulse = math.inf
        self.drift = 0.0
        leans, speeds = np.array([START]), np.zeros(1)
        while True:
            before = energy(leans, speeds)
            leans, speeds = self.fall(leans, speeds)
            self.drift = max(self.drift, abs(energy(leans, speeds) - before))
            if len(leans) == PLATES:
                return
            leans = np.append(leans, 0.0)
            momenta = INERTIA * np.append(speeds, 0.0)
            speeds, pushes = solve(momenta, leans, np.zeros(len(leans) - 1))
            self.least_impulse = min(self.least_impulse, float(pushes.min()))

    def fall(self, leans: FloatArray, speeds: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Until the foremost plate strikes the next one, or where that would be."""
        n = len(leans)

        def change(_: float, state: FloatArray) -> FloatArray:
            return np.concatenate([state[n:], forces(state[:n], state[n:])[0]])

        def strikes(_: float, state: FloatArray) -> float:
            return gap(state[n - 1], 0.0)

        event: Callable[[float, FloatArray], float] = strikes
        event.terminal = True  # type: ignore[attr-defined]
        start = np.concatenate([leans, speeds])
        found = solve_ivp(change, (0, 5), start, "DOP853", events=event, rtol=1e-9, atol=1e-11)
        for state in found.y.T if n > 1 else ():
            self.least_force = min(self.least_force, forces(state[:n], state[n:])[1].min())
        self.times.append(float(found.t[-1]))
        return found.y[:n, -1], found.y[n:, -1]


@pytest.fixture(scope="module")
def row() -> Row:
    return Row()


def test_the_laws_times_are_those_of_plates_that_push_each_other(row: Row) -> None:
    assert row.times[0] == pytest.approx(domino.fall(), rel=1e-6)
    assert row.times[1:] == pytest.approx(domino.passages(PLATES), rel=1e-5)
    assert row.drift < 1e-6


def test_the_weight_of_an_upright_plate_lies_half_as_high_as_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name, value in (("HEIGHT", 0.5), ("MASS", 3.0), ("INERTIA", 0.7)):
        monkeypatch.setattr(domino, name, value)
    assert domino.potential(0.0, 1) == pytest.approx(3.0 * GRAVITY * 0.25)
    assert domino.potential(math.pi / 3, 1) == pytest.approx(3.0 * GRAVITY * 0.125)
    assert domino.inertia(0.3, 1) == pytest.approx(0.7)


def test_plates_that_fell_stay_together(row: Row) -> None:
    """No plate pulls another one, neither between impacts nor in one: least force 0.118 m g."""
    assert row.least_force > 0.1 * MASS * GRAVITY
    assert row.least_impulse > 0.01
