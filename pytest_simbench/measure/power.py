"""How many repetitions a claim or a comparison needs."""

from __future__ import annotations

import math

from pytest_simbench.measure.intervals import CONFIDENCE, Interval, wilson

MOST = 10_000
"""Repetitions beyond which a claim is called out of reach: the truth is at its threshold."""


def further_repetitions(interval: Interval, threshold: float) -> int | None:
    """About how many more repetitions until the interval leaves the threshold, all staying alike.

    An estimate: the mean and the spread seen so far are taken for the true ones.

    Returns:
        0 when the interval does not hold the threshold; None when more than `MOST` would be needed,
        or when there is too little to tell (a single value).
    """
    if threshold not in interval or interval.low == interval.high:
        return 0
    if interval.n == 0 or not math.isfinite(interval.half_width):
        return None
    if interval.method == "wilson":
        total = repetitions_for_proportion(interval.mean, threshold, interval.confidence)
    else:
        away = abs(interval.mean - threshold)
        reach = interval.mean - interval.low
        if interval.mean < threshold:
            reach = interval.high - interval.mean
        total = math.ceil(interval.n * (reach / away) ** 2) if away * MOST > reach else None
    if total is None or total > MOST:
        return None
    return max(1, total - interval.n)


def repetitions_for_proportion(
    rate: float, threshold: float, confidence: float = CONFIDENCE
) -> int | None:
    """Fewest repetitions whose Wilson interval leaves the threshold when `rate` of them succeed.

    For instance 35 to show at least 0.9 with every one a success. None when `MOST` do not suffice.
    """

    def leaves(n: int) -> bool:
        found = wilson(rate * n, n, confidence)
        return found.low >= threshold if rate > threshold else found.high < threshold

    if not leaves(MOST):
        return None
    low, high = 0, MOST  # the width shrinks with n, so bisection finds the fewest
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if leaves(middle) else (middle, high)
    return high


def repetitions_for_mean(std: float, half_width: float, confidence: float = CONFIDENCE) -> int:
    """Repetitions that make a mean's interval `half_width` on each side, for values of that spread.

    Args:
        std: standard deviation between repetitions.
        half_width: wanted, in the same unit; above 0.
        confidence: of the interval.
    """
    from scipy.stats import norm

    return max(2, math.ceil((float(norm.ppf((1 + confidence) / 2)) * std / half_width) ** 2))


def repetitions_to_detect(
    difference: float, std: float, *, power: float = 0.8, alpha: float = 0.05, paired: bool = False
) -> int:
    """Repetitions on each side that find a true difference of two means, one-sided as a gate asks.

    Args:
        difference: between the true means; above 0.
        std: standard deviation between repetitions; of the differences where seeds pair.
        power: probability of finding it.
        alpha: probability of a false alarm.
        paired: whether the two sides share their seeds.
    """
    from scipy.stats import norm

    quantiles = float(norm.ppf(1 - alpha) + norm.ppf(power))
    return max(2, math.ceil((1 if paired else 2) * (quantiles * std / difference) ** 2))
