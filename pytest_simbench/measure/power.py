"""How many repetitions a claim needs, and what a test lets pass."""

from __future__ import annotations

import math
from bisect import bisect_left

from pytest_simbench.measure.intervals import CONFIDENCE, Interval, interval, proportion
from pytest_simbench.records.metrics import Metric

MOST = 10_000
"""Repetitions beyond which a claim is called out of reach: the truth is at its threshold."""


def further_repetitions(interval: Interval, threshold: float) -> int | None:
    """About how many more repetitions until the interval leaves the threshold, all staying alike.

    An estimate: the mean and the spread seen so far are taken for the true ones.

    Returns:
        0 when the interval does not hold the threshold; None when more than `MOST` would be needed,
        or when there is too little to tell (a single value).
    """
    if threshold not in interval:
        return 0
    if interval.n == 0 or not math.isfinite(interval.half_width):
        return None
    if interval.method == "exact":
        total = repetitions_for_proportion(interval.mean, threshold, interval.confidence)
    else:
        away = abs(interval.mean - threshold)
        reach = interval.mean - interval.low
        if interval.mean < threshold:
            reach = interval.high - interval.mean
        # The interval of shares that are all 0 or all 1 shrinks with n, others with its root.
        power = 1 if interval.method == "betting" and interval.mean in (0.0, 1.0) else 2
        total = math.ceil(interval.n * (reach / away) ** power) if away * MOST > reach else None
    if total is None or total > MOST:
        return None
    return max(1, total - interval.n)


def repetitions_for_proportion(
    rate: float, threshold: float, confidence: float = CONFIDENCE
) -> int | None:
    """Fewest repetitions whose interval leaves the threshold when `rate` of them succeed.

    For instance 36 to show at least 0.9 with every one a success. None when `MOST` do not suffice.
    """

    def leaves(n: int) -> bool:
        found = proportion(rate * n, n, confidence)
        return found.low >= threshold if rate > threshold else found.high < threshold

    if not leaves(MOST):
        return None
    return 1 + bisect_left(range(1, MOST), True, key=leaves)  # the width shrinks with n


def least_supported(threshold: float, metric: Metric, n: int, confidence: float) -> int | None:
    """How many of `n` repetitions must be whole successes, the others whole losses, for "at least
    `threshold`" of a proportion to be supported; None when `n` are too few."""
    return next((k for k in range(n + 1) if _of(k, n, metric, confidence).low >= threshold), None)


def passing_rate(
    threshold: float, metric: Metric, n: int, chance: float, confidence: float
) -> float:
    """The true rate of successes at which "at least `threshold`" is not refuted by `n` repetitions
    with a probability of `chance`.

    Whole repetitions succeed or fail, which is the hardest case of a share. The rate at which "at
    most t" passes is 1 less that of "at least 1 - t".

    Args:
        threshold: of the claim, 0..1.
        metric: yes or no, or a share.
        n: repetitions.
        chance: 0.5, or 0.05 for the rate that a test all but always finds out.
        confidence: of the interval by which the claim is judged, see `verdicts.confidence`.
    """
    from scipy.stats import beta

    passing = next(k for k in range(n + 1) if _of(k, n, metric, confidence).high >= threshold)
    # P(k or more of n) at rate p is the beta distribution's cdf at p.
    return float(beta.ppf(chance, passing, n - passing + 1)) if passing else 0.0


def alike_rate(threshold: float, metric: Metric, n: int, confidence: float) -> float:
    """The mean share below which "at least `threshold`" is refuted by `n` repetitions that all
    have that share: the easiest case, as `passing_rate` is the hardest."""
    low, high = 0.0, threshold
    while high - low > 1e-3:
        middle = (low + high) / 2
        refuted = interval([middle] * n, metric, confidence).high < threshold
        low, high = (middle, high) if refuted else (low, middle)
    return low


def _of(successes: int, n: int, metric: Metric, confidence: float) -> Interval:
    return interval([1.0] * successes + [0.0] * (n - successes), metric, confidence)
