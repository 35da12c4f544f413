"""Friction of pairs: each engine makes that of two surfaces by a rule of its own.

Every rule is a mean: of two equal frictions it makes the same one. A scene of one friction is
therefore the same by every rule; for others there is `pair_friction`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pytest_simbench.scene.pose import FloatArray

LEAST = 1e-6
"""Stands for no friction where a rule cannot have it."""


def _of_means(pairs: FloatArray, asked: FloatArray, count: int) -> FloatArray:
    """Numbers (count,) of which each pair (n, 2) has the mean `asked` (n,), or nearly so."""
    share = np.zeros((len(pairs), count))
    for row, (first, second) in zip(share, pairs, strict=True):
        row[first] += 0.5
        row[second] += 0.5  # of one with itself 1
    return np.asarray(np.linalg.lstsq(share, asked, rcond=None)[0])


def _of_largest(pairs: FloatArray, asked: FloatArray, count: int) -> FloatArray:
    """Numbers of which no pair has a larger maximum than `asked`: the largest such."""
    found = np.full(count, np.inf)
    for pair, most in zip(pairs, asked, strict=True):
        found[pair] = np.minimum(found[pair], most)
    return found


def _of_smallest(pairs: FloatArray, asked: FloatArray, count: int) -> FloatArray:
    """Numbers of which no pair has a smaller minimum than `asked`: the smallest such."""
    return -_of_largest(pairs, -asked, count)


def _transformed(
    there: Callable[[FloatArray], FloatArray], back: Callable[[FloatArray], FloatArray]
) -> Callable[[FloatArray, FloatArray, int], FloatArray]:
    return lambda pairs, asked, count: back(_of_means(pairs, there(asked), count))


RULES: dict[str, Callable[[FloatArray, FloatArray], FloatArray]] = {
    "maximum": np.maximum,
    "minimum": np.minimum,
    "mean": lambda a, b: (a + b) / 2,
    "geometric": lambda a, b: np.sqrt(a * b),
    "harmonic": lambda a, b: 2 * a * b / np.maximum(a + b, LEAST),
}
"""What a rule makes of the frictions of two surfaces. An engine that takes their product is given
the roots, and is `geometric`."""

SOLVED: dict[str, Callable[[FloatArray, FloatArray, int], FloatArray]] = {
    "maximum": _of_largest,
    "minimum": _of_smallest,
    "mean": _of_means,
    "geometric": _transformed(lambda mu: np.log(np.maximum(mu, LEAST)), np.exp),
    "harmonic": _transformed(
        lambda mu: 1 / np.maximum(mu, LEAST), lambda r: 1 / np.maximum(r, LEAST)
    ),
}
"""By rule: numbers of which it makes of each pair (n, 2) the one asked for, or nearly so."""
