"""Do two simulators, modes or runs differ, or do they agree? Tests on their repetitions.

Where the two sides share their seeds (same cube order, same jitter) their values are paired, which
removes what the seeds have in common. The test is a permutation test of the difference of
means: it asks what the tables show, needs no distribution, and bears ties.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pytest_simbench.measure.intervals import CONFIDENCE, SEED, betting, proportion

ALPHA = 1 - CONFIDENCE
"""Probability of a false alarm of every test, unless said otherwise."""

PERMUTATIONS = 9999
"""Random permutations where not all are tried; p is then exact to about 0.002 at 0.05."""

MANY = 100
"""Values on each side from which permutations are drawn by ourselves, or not at all where their
result is known. scipy takes 70 ms for so many, and hours and gigabytes at 100,000 records."""

EFFECTIVE = 500.0
"""So many values must carry a difference for its permutations to be normal; of rare failures only
the failed ones do. A p value of 0.05 is then right to 0.003, also for counts."""

MARGIN = 0.05
"""Shares that differ by less than this count as the same: not a whole cube of 15."""

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
        sole: whether more of them would be the same, so that nothing is left to chance.
    """

    first: float
    second: float
    p_value: float
    paired: bool
    n: tuple[int, int]
    sole: bool = False

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
    first: Mapping[int, float],
    second: Mapping[int, float],
    alternative: Alternative = "two-sided",
    *,
    sole: bool = False,
    permutations: int = 0,
) -> MeanDifference:
    """Test whether `second` differs from `first`, paired where nearly all seeds are on both sides.

    Args:
        sole: more repetitions would be the same: the means differ, or they do not.
        permutations: see `compare`.

    Raises:
        ValueError: an empty side.
    """
    shared = len(first.keys() & second.keys())
    paired = shared >= max(2, math.ceil(COMMON_SEEDS * min(len(first), len(second))))
    sides = pair(first, second) if paired else ([*first.values()], [*second.values()])
    found = compare(*sides, paired=paired, alternative=alternative, permutations=permutations)
    if not sole:
        return found
    apart = not math.isclose(found.first, found.second, rel_tol=1e-12)
    wrong_way = {"two-sided": False, "less": found.difference > 0, "greater": found.difference < 0}
    return replace(found, p_value=float(not apart or wrong_way[alternative]), sole=True)


def compare(
    first: ArrayLike,
    second: ArrayLike,
    *,
    paired: bool = False,
    alternative: Alternative = "two-sided",
    permutations: int = 0,
) -> MeanDifference:
    """Test whether `second` differs from `first` (is `less`, is `greater`).

    Args:
        first, second: values (n,) and (m,); pairs in order where paired.
        paired: whether they share their seeds.
        alternative: the direction of the difference second - first.
        permutations: that are drawn where there are more, at most; 0: `PERMUTATIONS`.

    Raises:
        ValueError: an empty side, or pairs of different numbers.
    """
    a, b = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    if not a.size or not b.size:
        raise ValueError("nothing to compare: a side has no repetitions")
    if paired and a.size != b.size:
        raise ValueError(f"pairs need as many values on each side, not {a.size} and {b.size}")
    p = _permutation(a, b, paired, alternative, permutations or PERMUTATIONS)
    return MeanDifference(float(a.mean()), float(b.mean()), p, paired, (a.size, b.size))


def _permutation(
    a: FloatArray, b: FloatArray, paired: bool, alternative: Alternative, permutations: int
) -> float:
    from scipy import stats

    if min(a.size, b.size) < 2:
        return 1.0  # one repetition cannot be told from chance; scipy refuses it
    scale = max(float(np.abs(a).max()), float(np.abs(b).max())) or 1.0
    if min(a.size, b.size) > MANY:
        if paired:
            return _signs(b - a, scale, alternative, permutations)
        both = np.concatenate([a, b]) - np.concatenate([a, b]).mean()
        variance = float((both**2).sum()) / (both.size - 1) * (1 / a.size + 1 / b.size)
        if _carrying(both) >= EFFECTIVE:
            return _normal(float(b.mean() - a.mean()), variance, alternative)

    def mean_difference(second: Any, first: Any, axis: int = -1) -> Any:
        difference = np.mean(second, axis=axis) - np.mean(first, axis=axis)
        return np.round(difference / scale, 12)  # sums in another order are still ties

    found = stats.permutation_test(
        (b, a),
        mean_difference,
        permutation_type="samples" if paired else "independent",
        vectorized=True,
        n_resamples=permutations,
        alternative=alternative,
        rng=np.random.default_rng(SEED),
        batch=max(1, 10**8 // (a.size + b.size)),
    )
    return float(found.pvalue)


def _signs(
    differences: FloatArray, scale: float, alternative: Alternative, permutations: int
) -> float:
    """The same of many pairs: each permutation changes the signs of some differences."""
    parts = differences[np.abs(differences) > 1e-12 * scale]  # equal pairs change none
    if parts.size < 2:
        return 1.0
    if _carrying(parts) >= EFFECTIVE:
        return _normal(float(parts.sum()), float((parts**2).sum()), alternative)
    rng, parts = np.random.default_rng(SEED), parts / scale / parts.size
    bits = rng.integers(0, 256, (permutations, -(-parts.size // 8)), dtype=np.uint8)
    flips = np.unpackbits(bits, axis=1, count=parts.size)
    sums = np.concatenate([part.astype(float) @ parts for part in np.array_split(flips, 20)])
    drawn, observed = np.round(parts.sum() - 2 * sums, 12), np.round(parts.sum(), 12)
    less, greater = (
        (1 + int((drawn <= observed).sum())) / (1 + permutations),
        (1 + int((drawn >= observed).sum())) / (1 + permutations),
    )
    found = {"less": less, "greater": greater, "two-sided": 2 * min(less, greater)}
    return min(1.0, found[alternative])


def _carrying(parts: FloatArray) -> float:
    """How many equal values would carry as much of the sum of squares as these do."""
    largest = float(np.abs(parts).max())
    squares = (parts / largest) ** 2 if largest else np.ones_like(parts)
    return float(squares.sum()) ** 2 / float((squares**2).sum())


def _normal(difference: float, variance: float, alternative: Alternative) -> float:
    """What the permutations of many values give: a normal difference with mean 0. Its variance is
    exact: sum(d^2) of the signs of pairs, and where n and m values change sides the variance of all
    values times 1 / n + 1 / m."""
    from scipy.special import ndtr

    if not variance:
        return 1.0
    z = difference / math.sqrt(variance)
    less = {"less": z, "greater": -z, "two-sided": -abs(z)}[alternative]
    return float(ndtr(less)) * (2 if alternative == "two-sided" else 1)


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


def alike(first: ArrayLike, second: ArrayLike, margin: float, *, yes_no: bool) -> bool:
    """Whether the means of shares, of the same seeds, (n,) each, differ by less than a margin.

    A t test takes one lost repetition of 60 for a sure thing. So the mean loss, and the mean gain,
    is bounded by how often there is one at all (Clopper, Pearson), or, of what is not `yes_no`, by
    the lower of that and bets; a bound is wrong in at most 5 % of runs.
    """
    gaps = np.asarray(second, dtype=float) - np.asarray(first, dtype=float)
    confidence = 1 - (2 if yes_no else 1) * ALPHA

    def most(lost: FloatArray) -> float:
        often = proportion(int((lost > 0).sum()), lost.size, confidence).high
        return often if yes_no else min(often, betting(lost.tolist(), confidence).high)

    return max(most(np.maximum(gaps, 0.0)), most(np.maximum(-gaps, 0.0))) < margin


def fewest_alike(margin: float, *, yes_no: bool) -> int:
    """Fewest pairs, all of them equal, that show it: 59 of yes or no for 5 points, else 72."""
    return math.ceil(math.log(ALPHA if yes_no else ALPHA / 2) / math.log1p(-margin))
