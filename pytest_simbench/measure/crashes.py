"""Did more repetitions crash than before? Exact tests, and their part of the gate's error.

Crashes are rare, so few tests of a run could ever show a rise: a test without a crash on either
side cannot. How many crashed on both sides together says which can, and says nothing of the side
on which they did. So only those are corrected for (Tarone 1990, A modified Bonferroni method for
discrete data, Biometrics 46), and a run without any leaves the limits the whole error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pytest_simbench.measure.comparison import ALPHA, pair

PART = 0.7
"""Of the error, where a rise could be shown; the limits have the rest. Five crashes of twenty where
there was none (p = 1/32) are then found, beside any limits."""


def rise(
    before: Mapping[int, float], after: Mapping[int, float], paired: bool
) -> tuple[float, float]:
    """The p value of more crashes than before, and the smallest that so many crashes could give.

    Of pairs a sign test of those that differ, else Fisher's exact test.

    Args:
        before, after: 1 for each repetition that crashed, else 0, by seed; none is empty.
        paired: whether the same seeds are on both sides.
    """
    from scipy.stats import binom, hypergeom

    if paired:
        first, second = pair(before, after)
        more, differ = int((second > first).sum()), int((second != first).sum())
        return float(binom.sf(more - 1, differ, 0.5)), 0.5**differ
    crashed, here = int(sum(before.values()) + sum(after.values())), len(after)
    chance = hypergeom(len(before) + here, crashed, here)
    return float(chance.sf(sum(after.values()) - 1)), float(chance.sf(min(crashed, here) - 1))


def corrected(found: Sequence[tuple[float, float]]) -> tuple[list[float], float]:
    """The p values of `rise`, corrected, and the part of the error that is left for the limits.

    By Hochberg's step up among those that could be significant: where many tests crash more, each
    is as sure as the least sure of them. It holds for what is independent or moves together
    (Hochberg 1988, A sharper Bonferroni procedure, Biometrika 75).
    """
    p_values = [min(1.0, p_value / PART) for p_value, _ in found]
    possible = [k for k, (_, least) in enumerate(found) if least <= ALPHA * PART]
    smallest = 1.0
    for rank, k in enumerate(sorted(possible, key=lambda k: -found[k][0]), start=1):
        smallest = min(smallest, rank * found[k][0] / PART)
        p_values[k] = smallest
    return p_values, 1 - PART if possible else 1.0
