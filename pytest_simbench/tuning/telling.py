"""What a fit tells of each unknown: an interval, or why the log does not determine it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.stats import t

from pytest_simbench.scene import FloatArray
from pytest_simbench.tuning.fitting import Fit, State
from pytest_simbench.tuning.target import TuningError
from pytest_simbench.tuning.unknowns import Unknown

LEVEL = 0.95

WIDE = math.log(2)
"""Half an interval: of what the log leaves open by more than a factor of two it tells nothing."""

LINKED = 0.9
"""Correlation of two unknowns that the log tells together."""


@dataclass(frozen=True)
class Told:
    """What a log tells of an unknown.

    Attributes:
        low, high: ends of the 95 % interval.
        why: it is not determined; empty where it is.
    """

    unknown: Unknown
    value: float
    low: float
    high: float
    why: str = ""


def told(fit: Fit, at: State) -> Iterator[Told]:
    """What the log tells of each unknown, from the slopes where the fit ended.

    Raises:
        TuningError: the log is too short to tell anything.
    """
    fewer = [np.full(rows.size, math.sqrt(_follow(rows))) for rows in at.columns.values()]
    slopes = at.slopes / np.concatenate(fewer)[:, None]
    known, many = slopes.T @ slopes, len(slopes)
    freedom = many - len(known) - 3 * sum("/" in name for name in at.columns)
    if freedom < 1:
        raise TuningError(f"{many} numbers of the log do not tell {len(known)}: give a longer log")
    factor = t.ppf((1 + LEVEL) / 2, freedom) * (1.0 if fit.noise else math.sqrt(many / freedom))
    cov = np.linalg.inv(known + 1e-9 * np.eye(len(known)))
    sd = np.sqrt(np.diag(cov))
    names = [one.name for one in fit.unknowns] + list(fit.starts)
    misfit = fit.misfit(at.columns)
    for k, one in enumerate(fit.unknowns):
        x, low, high, why = at.point[k], fit.low[k], fit.high[k], ""
        alone, half = factor / math.sqrt(known[k, k] + 1e-9), factor * sd[k]
        at_end = float(np.linalg.norm(at.slopes[:, k])) > factor / WIDE
        at_end = at_end and not low + 1e-6 < x < high - 1e-6
        together = half > max(WIDE, 2 * alone)
        alone = alone if at_end or misfit else fit.widened(at, k, alone)
        half = max(alone, half)
        open_ = [w > WIDE or not (at_end or low < x - w < x + w < high) for w in (alone, half)]
        if at_end and not together:
            why = "the best lies at the end of its range: give a wider one"
        elif misfit:
            why = f"no values were found that explain the log; the best is {math.exp(x):.4g}"
        elif open_[0]:
            why = "what was measured hardly depends on it, or jumps about as it changes"
        elif open_[1]:
            linked = cov[k] / (sd[k] * sd)
            linked[k] = 0.0
            least = min(LINKED, np.abs(linked).max())
            over = " and ".join(n for n, c in zip(names, linked, strict=True) if c >= least)
            by = " and ".join(n for n, c in zip(names, linked, strict=True) if -c >= least)
            parts = [over and f"its ratio to {over}", by and f"its product with {by}"]
            why = f"the log tells {' and '.join(filter(None, parts))} alone"
        ends = np.exp(np.clip([x - half, x + half], low, high))
        yield Told(one, math.exp(x), float(ends[0]), float(ends[1]), why)


def _follow(rows: FloatArray) -> float:
    """For how many one residual stands: more than 1 where each is like the one before, by their
    correlation (1 + c) / (1 - c)."""
    c = float(np.sum(rows[1:] * rows[:-1]) / max(np.sum(rows**2), 1e-300))
    return (1 + c) / (1 - c) if c > 3 / math.sqrt(rows.size) else 1.0
