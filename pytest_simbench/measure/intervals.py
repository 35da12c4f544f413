"""Confidence intervals: how far the truth may be from the mean of the repetitions.

Which one is used where:

- a yes-or-no metric (a proportion of repetitions): Wilson's score interval;
- a mean of shares or values: the bias-corrected accelerated bootstrap (BCa);
- shares that are all equal: Wilson's interval for as many repetitions, since a bootstrap of equal
  values has no width, and 20 of 20 proves only 0.84;
- values that are all equal: the value itself, marked degenerate (a deterministic simulator).

A plain bootstrap is too narrow for few values (95 % BCa intervals of 5 normal values hold the truth
82 times in 100, of 20 values 93 times), so its level is raised as Hesterberg proposes, to 91 and 95
times (see `expanded_level`; tests/measure/test_intervals.py measures the coverage). No interval
knows of what has not happened yet: what strikes one repetition in twenty leaves no trace in a third
of the runs of 20, and their intervals are then too narrow or too high.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

CONFIDENCE = 0.95
"""Confidence of every interval unless said otherwise."""

RESAMPLES = 9999
"""Bootstrap resamples: scipy's default; the ends of an interval are then stable to about 1 %."""

SEED = 20220406
"""Of every resampling, so that the same records always give the same verdict."""


@dataclass(frozen=True)
class Interval:
    """A mean (or another estimate) and the range that holds the truth with `confidence`.

    Attributes:
        mean: the estimate; nan without values.
        low: lower end; -inf where nothing is known.
        high: upper end; inf where nothing is known.
        n: number of repetitions behind it.
        method: `wilson`, `bca`, `percentile`, `constant` or `none`.
        degenerate: all values were equal, so the interval's width says nothing about the next one.
        confidence: probability that such intervals hold the truth.
    """

    mean: float
    low: float
    high: float
    n: int
    method: str
    degenerate: bool = False
    confidence: float = CONFIDENCE

    def __contains__(self, value: float) -> bool:
        return self.low <= value <= self.high

    @property
    def half_width(self) -> float:
        return (self.high - self.low) / 2

    def to_wire(self) -> dict[str, Any]:
        """Plain data; ends that are not known become None."""
        return {
            "mean": _known(self.mean),
            "low": _known(self.low),
            "high": _known(self.high),
            "n": self.n,
            "method": self.method,
            "degenerate": self.degenerate,
            "confidence": self.confidence,
        }


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def wilson(successes: float, n: int, confidence: float = CONFIDENCE) -> Interval:
    """Wilson's score interval of a proportion.

    Args:
        successes: how many of `n`; a sum of shares may be a fraction, and is then rounded outwards
            (down for the lower end, up for the upper), since scipy counts in whole things.
        n: at least 1.
        confidence: of the interval.

    Raises:
        ValueError: not 0 <= successes <= n, or n < 1.
    """
    from scipy.stats import binomtest

    if n < 1 or not 0 <= successes <= n:
        raise ValueError(
            f"a proportion needs 0 <= successes <= n and n >= 1, not {successes} of {n}"
        )
    count = round(successes, 9)
    below = binomtest(math.floor(count), n).proportion_ci(confidence, method="wilson")
    above = binomtest(math.ceil(count), n).proportion_ci(confidence, method="wilson")
    return Interval(
        successes / n,
        max(0.0, float(below.low)),
        min(1.0, float(above.high)),
        n,
        "wilson",
        count in (0, n),
        confidence,
    )


def expanded_level(confidence: float, n: int) -> float:
    """Confidence level at which a bootstrap of `n` values is as wide as Student's t interval.

    alpha' / 2 = Phi(-sqrt(n / (n - 1)) t(1 - alpha / 2, n - 1)): Hesterberg 2015, What teachers
    should know about the bootstrap, The American Statistician 69 (4), the expanded percentile
    interval.
    """
    from scipy.stats import norm, t

    quantile = float(t.ppf((1 + confidence) / 2, n - 1))
    return 1 - 2 * float(norm.cdf(-math.sqrt(n / (n - 1)) * quantile))


def bootstrap(
    values: ArrayLike,
    statistic: Callable[..., Any] = np.mean,
    confidence: float = CONFIDENCE,
    resamples: int = RESAMPLES,
) -> Interval:
    """BCa bootstrap interval of a statistic of values (n,), with a fixed seed and expanded level.

    Where BCa is not defined (few different values) the percentile interval is given; equal values
    give the value itself, marked degenerate; a single value says nothing of its spread.
    """
    from scipy import stats

    sample = np.asarray(values, dtype=float)
    if sample.size < 2:
        mean = float(sample[0]) if sample.size else math.nan
        return Interval(mean, -math.inf, math.inf, sample.size, "none", True, confidence)
    if np.ptp(sample) <= 1e-12 * max(1.0, float(np.abs(sample).max())):
        value = float(statistic(sample))
        return Interval(value, value, value, sample.size, "constant", True, confidence)
    level = expanded_level(confidence, sample.size)
    for method in ("BCa", "percentile"):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # DegenerateDataWarning: answered by the next method
            found = stats.bootstrap(
                (sample,),
                statistic,
                n_resamples=resamples,
                confidence_level=level,
                method=method,
                rng=np.random.default_rng(SEED),
            ).confidence_interval
        if np.isfinite(found).all():
            break
    return Interval(
        float(statistic(sample)),
        float(found.low),
        float(found.high),
        sample.size,
        method.lower(),
        False,
        confidence,
    )


def interval(
    values: Sequence[float], *, bounded: bool = False, confidence: float = CONFIDENCE
) -> Interval:
    """Interval of the mean of a metric's values, one for each repetition.

    Args:
        values: (n,).
        bounded: whether the values are shares or yes-or-no, in 0..1.
        confidence: of the interval.

    Raises:
        ValueError: a bounded value outside 0..1, or a value that is not finite.
    """
    sample = np.asarray(values, dtype=float)
    if not np.isfinite(sample).all():
        raise ValueError("values must be finite; leave out repetitions without one")
    if bounded and sample.size:
        if sample.min() < 0 or sample.max() > 1:
            raise ValueError(f"shares lie in 0..1, not {sample.min():g}..{sample.max():g}")
        equal = np.ptp(sample) < 1e-12
        if equal or np.isin(sample, (0.0, 1.0)).all():
            found = wilson(float(sample.sum()), sample.size, confidence)
            return Interval(
                found.mean, found.low, found.high, found.n, "wilson", bool(equal), confidence
            )
    return bootstrap(sample, np.mean, confidence, RESAMPLES)


def interquartile_mean(values: ArrayLike, axis: int = -1) -> Any:
    """Mean of the middle half of the values along `axis`: a quarter of them is cut at each end.

    As robust as a median and nearly as exact as a mean; one lost repetition does not move it.
    """
    from scipy.stats import trim_mean

    return trim_mean(np.asarray(values, dtype=float), 0.25, axis=axis)


def interquartile_interval(values: Sequence[float], confidence: float = CONFIDENCE) -> Interval:
    """Interval of the interquartile mean of values (n,)."""
    return bootstrap(values, interquartile_mean, confidence)
