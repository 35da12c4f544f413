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

TINY = 1e-9
"""Smaller is nothing."""

SMALLEST = 1e-3
"""Smaller frictions are alike."""

ROUNDS = 8
"""Of least squares, until the weights are right."""


def error(made: FloatArray, asked: FloatArray) -> FloatArray:
    """How far frictions are off: a share, where it is small."""
    return np.asarray(np.abs(np.log(_at_least(made) / _at_least(asked))))


def _at_least(frictions: FloatArray) -> FloatArray:
    return np.maximum(np.abs(frictions), SMALLEST)


def _shares(pairs: FloatArray, count: int) -> FloatArray:
    """Of each number (count,) in the mean of each pair (n, 2)."""
    share = np.zeros((len(pairs), count))
    for row, (first, second) in zip(share, pairs, strict=True):
        row[first] += 0.5
        row[second] += 0.5  # of one with itself 1
    return share


def _in_order(rows: FloatArray, asked: FloatArray, ranks: FloatArray) -> FloatArray:
    """Least squares of the first rank; of each further one with what those before leave free."""
    found, free = np.zeros(rows.shape[1]), np.eye(rows.shape[1])
    for rank in np.unique(ranks):
        own, goal = rows[ranks == rank], asked[ranks == rank]
        found = found + free @ np.linalg.lstsq(own @ free, goal - own @ found, rcond=None)[0]
        _, sizes, axes = np.linalg.svd(np.linalg.qr(own @ free, mode="r"))
        free = free @ axes[np.count_nonzero(sizes > TINY) :].T
    return found


def _of_means(pairs: FloatArray, asked: FloatArray, ranks: FloatArray, count: int) -> FloatArray:
    """Numbers (count,), none below 0, of which each pair (n, 2) has the mean `asked` (n,), or
    nearly so: where pairs have ranks, weights make differences those of logarithms."""
    share, weights = _shares(pairs, count), np.ones(len(asked))
    for _ in range(ROUNDS if ranks.any() else 1):
        found, kept = np.full(count, -1.0), np.ones(count, dtype=bool)
        while found.min() < -TINY:
            found = np.zeros(count)
            found[kept] = _in_order(weights[:, None] * share[:, kept], weights * asked, ranks)
            kept[found.argmin()] = False  # it is 0
        weights = 1 / np.sqrt(_at_least(share @ found) * _at_least(asked))
    return np.asarray(np.maximum(found, 0.0))


def _of_roots(pairs: FloatArray, asked: FloatArray, ranks: FloatArray, count: int) -> FloatArray:
    logarithms = np.log(np.maximum(asked, LEAST))
    return np.asarray(np.exp(_in_order(_shares(pairs, count), logarithms, ranks)))


def _of_inverses(pairs: FloatArray, asked: FloatArray, ranks: FloatArray, count: int) -> FloatArray:
    inverses = _of_means(pairs, 1 / np.maximum(asked, LEAST), ranks, count)
    return np.asarray(1 / np.maximum(inverses, LEAST))


def _of_smallest(pairs: FloatArray, asked: FloatArray, ranks: FloatArray, count: int) -> FloatArray:
    """Numbers of which no pair of the first rank has a smaller minimum than `asked`, the smallest
    such; so on with what is left. Then single ones change as long as errors become smaller."""
    found, levels = np.full(count, -np.inf), np.unique(ranks)
    for level in levels:
        least = np.full(count, -np.inf)
        for pair, value in zip(pairs[ranks == level], asked[ranks == level], strict=True):
            least[pair] = np.maximum(least[pair], value)
        found = np.where(np.isinf(found), least, found)
    before = np.zeros(0)
    while not np.array_equal(found, before):
        before = found.copy()
        for place in range(count)[::-1]:  # the ground, which most touch, comes last
            own = (pairs == place).any(axis=1)
            goals, values = asked[own], np.array([found[place], *np.unique(asked[own])])
            others = np.where(pairs[own] == place, np.inf, found[pairs[own]]).min(axis=1)
            off = error(np.minimum(values[:, None], others), goals) ** 2
            sums = [np.round(off[:, ranks[own] == level].sum(axis=1), 9) for level in levels]
            found[place] = values[min(range(len(values)), key=lambda k: [row[k] for row in sums])]
    return found


def _of_largest(pairs: FloatArray, asked: FloatArray, ranks: FloatArray, count: int) -> FloatArray:
    """The same of maxima."""
    return -_of_smallest(pairs, -asked, ranks, count)


RULES: dict[str, Callable[[FloatArray, FloatArray], FloatArray]] = {
    "maximum": np.maximum,
    "minimum": np.minimum,
    "mean": lambda a, b: (a + b) / 2,
    "geometric": lambda a, b: np.sqrt(a * b),
    "harmonic": lambda a, b: 2 * a * b / np.maximum(a + b, LEAST),
}
"""What a rule makes of the frictions of two surfaces. An engine that takes their product is given
the roots, and is `geometric`."""

SOLVED: dict[str, Callable[[FloatArray, FloatArray, FloatArray, int], FloatArray]] = {
    "maximum": _of_largest,
    "minimum": _of_smallest,
    "mean": _of_means,
    "geometric": _of_roots,
    "harmonic": _of_inverses,
}
"""By rule: numbers of which it makes of each pair (n, 2) the one asked for. Where there are none,
those of the smallest ranks (n,) come first; 0: pairs have none."""
