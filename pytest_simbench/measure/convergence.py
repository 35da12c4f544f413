"""How fast an error falls with the time step: the fitted order of convergence, and what it rests
on.

A method of order p has the error C h^p at small steps h (Hairer, Norsett, Wanner, Solving Ordinary
Differential Equations I, II.3), a straight line of slope p in the logarithms. The slope is found by
least squares, its interval by Student's t from how far the points lie off the line. What is left
over once the step explains nothing more is rounding, and says nothing of the order."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pytest_simbench.measure.intervals import CONFIDENCE

Kind = Literal["order", "exact", "rounding", "unknown"]

FALLS = 0.5
"""An error that falls at least as fast as the step's square root still tells of the step, however
small it is, as long as it goes on at the same rate:"""

SAME_RATE = 0.8
"""the slopes between neighbours differ by no larger factor."""

FEWEST = 3
"""Steps with an error above rounding, without which nothing is fitted: two tell a slope of any
size. A sweep of two steps tells just that, without an interval."""

A_FALL = 4
"""Steps in a row along which it must fall so where every error is as small as rounding: rounding
alone does that once in 24 times at most."""


@dataclass(frozen=True)
class Convergence:
    """What errors at several time steps tell.

    Attributes:
        kind: `order` was fitted; every error is 0 (`exact`); nearly all are `rounding`; or it is
            `unknown`, with fewer than two steps.
        order: the slope; nan where none was fitted.
        low, high: its 95 % interval; infinite for two steps, nan where none was fitted.
        points: errors that it was fitted to.
    """

    kind: Kind
    order: float = math.nan
    low: float = math.nan
    high: float = math.nan
    points: int = 0


def convergence(
    steps: Sequence[float], errors: Sequence[float], rounding: Sequence[float] | float = 0.0
) -> Convergence:
    """The order of convergence.

    Args:
        steps: time steps [s], all different, in any order.
        errors: at each of them, 0 or more, in any unit.
        rounding: what rounding may make of them, in that unit, at each step or at all of them.

    Raises:
        ValueError: a step that is not above 0 or is given twice, an error that is none.
    """
    h, e = np.asarray(steps, dtype=float), np.asarray(errors, dtype=float)
    if h.shape != e.shape or not (h > 0).all() or len(set(h)) != len(h):
        raise ValueError("an error is needed for each of several different time steps")
    if not (np.isfinite(e).all() and (e >= 0).all()):
        raise ValueError("an error is a finite number, 0 or more")
    order = np.argsort(-h)
    level = np.broadcast_to(np.asarray(rounding, dtype=float), h.shape)[order]
    h, e = h[order], e[order]
    if len(h) and not e.any():
        return Convergence("exact")
    if len(h) < 2:
        return Convergence("unknown")
    told = _told(h, e, level)
    if len(told) < min(FEWEST, len(h)):
        return Convergence("rounding")
    return _fitted(np.log(h[told]), np.log(e[told]))


def _told(h: np.ndarray, e: np.ndarray, level: np.ndarray) -> list[int]:
    """The places, longest step first, whose errors tell of the step: those above rounding, and
    those below it that go on falling."""
    found: list[int] = []
    above = e > level
    if rounding := not above.any():
        above[0] = True
    for k in range(len(h)):
        goes_on = found and found[-1] == k - 1 and _falls(h, e, k)
        if above[k] or goes_on:
            found.append(k)
    return [] if rounding and len(found) < A_FALL else found


def _falls(h: np.ndarray, e: np.ndarray, k: int) -> bool:
    """Whether the error at a place tells of the step as the one before it does."""
    if not (e[k] and e[k - 1]):
        return False
    slope = _slope(h, e, k)
    before = _slope(h, e, k - 1) if k > 1 and e[k - 2] else 0.0
    same = before < FALLS or SAME_RATE * before <= slope <= before / SAME_RATE
    return slope >= FALLS and same


def _slope(h: np.ndarray, e: np.ndarray, k: int) -> float:
    """From the place before to this one."""
    return math.log(e[k] / e[k - 1]) / math.log(h[k] / h[k - 1])


def _fitted(x: np.ndarray, y: np.ndarray) -> Convergence:
    """The slope of a straight line, and its interval."""
    from scipy.special import stdtrit

    dx = x - x.mean()
    spread = float(dx @ dx)
    slope = float(dx @ (y - y.mean())) / spread
    left = len(x) - 2
    if left < 1:
        return Convergence("order", slope, -math.inf, math.inf, len(x))
    off = y - y.mean() - slope * dx
    error = math.sqrt(float(off @ off) / left / spread)
    half = float(stdtrit(left, (1 + CONFIDENCE) / 2)) * error
    return Convergence("order", slope, slope - half, slope + half, len(x))
