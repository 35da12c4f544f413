"""Confidence intervals: how far the truth may be from the mean of the repetitions.

Which one is used where:

- yes or no (a proportion of repetitions): Clopper and Pearson's exact interval;
- shares: a betting interval, which holds for every distribution in 0..1 and any number of
  repetitions, also for what strikes one repetition in twenty and has not been seen yet. It is never
  much narrower below than a proportion's: 20 repetitions without a loss prove 80 %;
- values (lengths, costs): Student's t and Willink's t for skewed values, the wider ends of both. No
  interval of a mean without bounds can hold for every distribution; this one does for skewed costs
  up to a lognormal with sigma 1 (tests/measure/test_coverage.py), not for rare outliers: of 20
  values of which one in twenty is ten deviations off it holds the truth in 87 of 100 runs;
- values with a least one (counts, distances, costs): the same, and the bets of a betting interval
  give a lower end as well; the higher of the two counts. Such bets need no upper bound. Their end
  holds for every distribution and never lies below the least value, where t's does for rare counts;
- values that are all alike (within the metric's resolution): none. They are a deterministic
  simulator's, whose seeds do not matter, and so say nothing of a spread;
- fewer than `FEWEST` values: none, since nothing holds there; but one that would be repeated to the
  bit (`Notes.sole`) is constant.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.records.metrics import Metric

CONFIDENCE = 0.95
"""Confidence of every interval unless said otherwise."""

FEWEST = 5
"""Repetitions below which nothing is claimed: no verdict, no win, no interval of values."""

SEED = 20220406
"""Of every resampling, so that the same records always give the same verdict."""

GUARD = 0.4
"""Of the error of an interval of values, what Student's and Willink's t may use: measured for it
to hold 94 times in 100 also for skewed values, see tests/measure/test_coverage.py."""

_STAKES = np.array([*((np.arange(30) + 0.5) / 30), 1.0])
_CAPITAL = np.array([*[0.7 / 30] * 30, 0.3])
"""Stakes of a betting interval, and how much capital goes to each. The whole stake wins most where
nothing was ever lost, as in most good runs; 0.3 of the capital makes 20 perfect ones prove 80 %."""


@dataclass(frozen=True)
class Interval:
    """A mean and the range that holds the truth with `confidence`.

    Attributes:
        mean: the estimate; nan without values.
        low: lower end; -inf where nothing is known.
        high: upper end; inf where nothing is known.
        n: number of repetitions behind it.
        method: `exact`, `betting`, `t`, `constant` or `none`; see the module.
        confidence: probability that such intervals hold the truth, at least.
    """

    mean: float
    low: float
    high: float
    n: int
    method: str
    confidence: float = CONFIDENCE

    def __contains__(self, value: float) -> bool:
        return self.low <= value <= self.high

    @property
    def half_width(self) -> float:
        return (self.high - self.low) / 2


def proportion(successes: float, n: int, confidence: float = CONFIDENCE) -> Interval:
    """Clopper and Pearson's interval of a proportion (Biometrika 26, 1934): exact at every n.

    Args:
        successes: how many of `n`; a fraction is rounded outwards, down for the lower end and up
            for the upper.
        n: at least 1.
        confidence: of the interval; each end errs in at most half of the rest.

    Raises:
        ValueError: not 0 <= successes <= n, or n < 1.
    """
    from scipy.special import betaincinv  # far quicker than scipy.stats' beta.ppf

    if n < 1 or not 0 <= successes <= n:
        raise ValueError(
            f"a proportion needs 0 <= successes <= n and n >= 1, not {successes} of {n}"
        )
    count, error = round(successes, 9), (1 - confidence) / 2  # 2.9999999999999996 is 3
    least, most = math.floor(count), math.ceil(count)
    low = float(betaincinv(least, n - least + 1, error)) if least else 0.0
    high = float(betaincinv(most + 1, n - most, 1 - error)) if most < n else 1.0
    return Interval(successes / n, low, high, n, "exact", confidence)


def betting(values: Sequence[float], confidence: float = CONFIDENCE) -> Interval:
    """Interval of the mean of values (n,) in 0..1, whatever their distribution.

    Somebody bets on each value being above m, at odds that are fair if the mean is m, and gives
    parts of a capital of 1 to several stakes. His capital exceeds 1 / error with a probability of
    at most `error` if m is the mean (Ville's inequality), so what makes him that rich is no mean:
    Waudby-Smith and Ramdas 2024, Estimating means of bounded random variables by betting, Journal
    of the Royal Statistical Society B 86 (1). Stakes that are fixed beforehand make the result
    independent of the order of the values.

    Raises:
        ValueError: a value outside 0..1, or none.
    """
    sample = np.asarray(values, dtype=float)
    if not sample.size or sample.min() < 0 or sample.max() > 1:
        raise ValueError(f"shares lie in 0..1, not {list(values)[:5]}")
    rich = 2 / (1 - confidence)
    mean = float(sample.mean())
    low, high = _least_mean(sample, rich), 1 - _least_mean(1 - sample, rich)
    return Interval(mean, min(low, mean), max(high, mean), sample.size, "betting", confidence)


def _least_mean(sample: NDArray[np.float64], rich: float) -> float:
    """The smallest m at which bets on values above m do not make rich; the capital falls with m."""
    low, high = 0.0, float(sample.mean())
    different, counts = np.unique(sample, return_counts=True)  # shares of 15 cubes are 16 values
    while high - low > 1e-6:
        m = (low + high) / 2
        with np.errstate(divide="ignore"):  # a lost whole stake: log 0
            growth = np.log1p(_STAKES[:, None] * (different / m - 1)) @ counts
        if math.log(rich) <= float(np.logaddexp.reduce(np.log(_CAPITAL) + growth)):
            low = m
        else:
            high = m
    return low


def skewed_t(values: Sequence[float], confidence: float = CONFIDENCE) -> Interval:
    """Interval of the mean of values (n,) without bounds that may be skewed, n at least 3.

    The wider ends of Student's t and of Willink's (2005, A confidence interval and test for the
    mean of an asymmetric distribution, Communications in Statistics 34 (4)), which corrects for the
    third moment; one degree of freedom goes to that, and the error is cut to `GUARD` of itself.
    """
    from scipy.special import stdtrit

    sample = np.asarray(values, dtype=float)
    n, mean, std = sample.size, float(sample.mean()), float(sample.std(ddof=1))
    quantile = float(stdtrit(n - 2, 1 - GUARD * (1 - confidence) / 2))
    third = float(((sample - mean) ** 3).sum()) * n / ((n - 1) * (n - 2))
    skew = third / (6 * math.sqrt(n) * std**3)
    reach = [max(quantile, side * _willink(side * quantile, skew)) for side in (1, -1)]
    scale = std / math.sqrt(n)
    return Interval(mean, mean - reach[0] * scale, mean + reach[1] * scale, n, "t", confidence)


def _willink(quantile: float, skew: float) -> float:
    """The quantile of t as it is for values of that skewness: Willink's G, less than a cubic."""
    if abs(skew) < 1e-6:
        return quantile
    return float((np.cbrt(1 + 6 * skew * (quantile - skew)) - 1) / (2 * skew))


def varies(values: Sequence[float], metric: Metric) -> bool:
    """Whether a metric's values differ by more than its resolution, so that they have a spread."""
    sample = np.asarray(values, dtype=float)
    if not sample.size:
        return False
    rounding = 1e-12 * max(1.0, float(np.abs(sample).max()))
    return float(np.ptp(sample)) > max(metric.smallest_difference, rounding)


def interval(values: Sequence[float], metric: Metric, confidence: float = CONFIDENCE) -> Interval:
    """Interval of the mean of a metric's values (n,), one for each repetition.

    Raises:
        ValueError: a share outside 0..1, a value below the metric's least, or one that is not
            finite.
    """
    sample = [float(value) for value in values]
    if not all(map(math.isfinite, sample)):
        raise ValueError("values must be finite; leave out repetitions without one")
    if not sample:
        return Interval(math.nan, -math.inf, math.inf, 0, "none", confidence)
    if metric.bounded:
        if metric.kind == "yes_no" and set(sample) <= {0.0, 1.0}:
            return proportion(sum(sample), len(sample), confidence)
        return betting(sample, confidence)
    if metric.least is not None and min(sample) < metric.least:
        raise ValueError(f"{metric.name} is at least {metric.least:g}, not {min(sample):g}")
    if len(sample) >= FEWEST and varies(sample, metric):
        found = skewed_t(sample, confidence)
        return found if metric.least is None else _from(metric.least, found, sample)
    method = "none" if len(sample) < FEWEST else "constant"
    mean = math.fsum(sample) / len(sample)
    return Interval(mean, -math.inf, math.inf, len(sample), method, confidence)


def _from(least: float, found: Interval, sample: Sequence[float]) -> Interval:
    """An interval of values of which none can be below `least`."""
    above = np.asarray(sample, dtype=float) - least
    scale = float(above.mean())  # bets win shares, whatever the unit
    low = least + scale * _least_mean(above / scale, 2 / (1 - found.confidence))
    return replace(found, low=max(found.low, min(low, found.mean)))
