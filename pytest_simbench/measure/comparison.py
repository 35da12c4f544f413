"""Do two simulators, modes or runs differ, or do they agree? Tests on their repetitions.

Where the two sides share their seeds (same cube order, same jitter) their values are paired, which
removes what the seeds have in common. The test is a permutation test of the difference of
means: it asks what the tables show, needs no distribution, and bears ties.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pytest_simbench.measure.intervals import CONFIDENCE, SEED

ALPHA = 1 - CONFIDENCE
"""Probability of a false alarm of every test, unless said otherwise."""

PERMUTATIONS = 9999
"""Random permutations where not all are tried; p is then exact to about 0.002 at 0.05."""

COMMON_SEEDS = 0.9
"""Pair by seed when at least this share of the smaller side's seeds is on both sides."""

Alternative = Literal["two-sided", "less", "greater"]
FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class MeanDifference:
    """The difference second minus first of two means, and how likely it is by chance.

    Attributes:
        first, second: the means.
        p_value: probability of such a difference (in the direction asked for) without a true one.
        paired: whether values of the same seed were paired.
        n: repetitions on each side, or pairs.
    """

    first: float
    second: float
    p_value: float
    paired: bool
    n: tuple[int, int]

    @property
    def difference(self) -> float:
        return self.second - self.first

    def significant(self, alpha: float = ALPHA) -> bool:
        return self.p_value <= alpha


def pair(first: Mapping[int, float], second: Mapping[int, float]) -> tuple[FloatArray, FloatArray]:
    """The values of two sets by seed, for the seeds that both have, in the order of the seeds."""
    seeds = sorted(first.keys() & second.keys())
    return (
        np.array([first[seed] for seed in seeds], dtype=float),
        np.array([second[seed] for seed in seeds], dtype=float),
    )


def compare_by_seed(
    first: Mapping[int, float], second: Mapping[int, float], alternative: Alternative = "two-sided"
) -> MeanDifference:
    """Test whether `second` differs from `first`, paired where nearly all seeds are on both sides.

    Raises:
        ValueError: an empty side.
    """
    shared = len(first.keys() & second.keys())
    paired = shared >= max(2, math.ceil(COMMON_SEEDS * min(len(first), len(second))))
    sides = pair(first, second) if paired else ([*first.values()], [*second.values()])
    return compare(*sides, paired=paired, alternative=alternative)


def compare(
    first: ArrayLike,
    second: ArrayLike,
    *,
    paired: bool = False,
    alternative: Alternative = "two-sided",
) -> MeanDifference:
    """Test whether `second` differs from `first` (is `less`, is `greater`).

    Args:
        first, second: values (n,) and (m,); pairs in order where paired.
        paired: whether they share their seeds.
        alternative: the direction of the difference second - first.

    Raises:
        ValueError: an empty side, or pairs of different numbers.
    """
    a, b = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    if not a.size or not b.size:
        raise ValueError("nothing to compare: a side has no repetitions")
    if paired and a.size != b.size:
        raise ValueError(f"pairs need as many values on each side, not {a.size} and {b.size}")
    p = _permutation(a, b, paired, alternative)
    return MeanDifference(float(a.mean()), float(b.mean()), p, paired, (a.size, b.size))


def _permutation(a: FloatArray, b: FloatArray, paired: bool, alternative: Alternative) -> float:
    from scipy import stats

    if min(a.size, b.size) < 2:
        return 1.0  # one repetition cannot be told from chance; scipy refuses it
    scale = max(float(np.abs(a).max()), float(np.abs(b).max())) or 1.0

    def mean_difference(second: Any, first: Any, axis: int = -1) -> Any:
        difference = np.mean(second, axis=axis) - np.mean(first, axis=axis)
        return np.round(difference / scale, 12)  # sums in another order are still ties

    found = stats.permutation_test(
        (b, a),
        mean_difference,
        permutation_type="samples" if paired else "independent",
        vectorized=True,
        n_resamples=PERMUTATIONS,
        alternative=alternative,
        rng=np.random.default_rng(SEED),
    )
    return float(found.pvalue)


def holm(p_values: Sequence[float]) -> list[float]:
    """Holm's adjusted p values, in the same order: none of many comparisons alarms falsely.

    Compare each with alpha; the chance of one or more false alarms among all is then at most alpha
    (Holm 1979, A simple sequentially rejective multiple test procedure). scipy has only the
    correction of the false-discovery rate.
    """
    adjusted = [0.0] * len(p_values)
    largest = 0.0
    for rank, index in enumerate(sorted(range(len(p_values)), key=lambda k: p_values[k])):
        largest = max(largest, min(1.0, (len(p_values) - rank) * p_values[index]))
        adjusted[index] = largest
    return adjusted


@dataclass(frozen=True)
class Equivalence:
    """Whether two means differ by less than a margin, by two one-sided tests.

    Attributes:
        difference: of the means, second - first.
        margin: the largest difference that does not matter; same unit.
        p_value: the larger of the two tests'.
    """

    difference: float
    margin: float
    p_value: float

    def equivalent(self, alpha: float = ALPHA) -> bool:
        return self.p_value <= alpha


def equivalence(first: ArrayLike, second: ArrayLike, margin: float) -> Equivalence:
    """Two one-sided paired t tests (TOST): "headless and GUI do not differ by more than `margin`".

    Not significantly different is not the same as equivalent: few repetitions show neither.

    Args:
        first, second: values of the same seeds, (n,) each, at least two.
        margin: above 0.

    Raises:
        ValueError: fewer than two values on a side, unequal pairs, or a margin that is not above 0.
    """
    from scipy import stats

    a, b = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    if margin <= 0:
        raise ValueError(f"the margin of an equivalence must be above 0, not {margin:g}")
    if a.size < 2 or a.size != b.size:
        raise ValueError(f"equivalence needs two or more pairs, not {a.size} and {b.size} values")
    difference = float(b.mean() - a.mean())
    if np.ptp(b - a) <= 1e-12 * max(1.0, float(np.abs(a).max())):
        return Equivalence(difference, margin, 0.0 if abs(difference) < margin else 1.0)
    sides: tuple[tuple[FloatArray, Alternative], ...] = (
        (b + margin, "greater"),
        (b - margin, "less"),
    )
    found = [stats.ttest_rel(side, a, alternative=way).pvalue for side, way in sides]
    return Equivalence(difference, margin, float(max(found)))
