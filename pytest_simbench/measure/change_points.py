"""Where in a row of releases did a metric change? Supported change points, by permutation.

Binary segmentation: the split of a row that moves the mean most, weighted by how many values lie
on each side (the CUSUM statistic), is a change point when chance seldom gives one as large; then
each side is searched likewise. Chance is what permuting the releases gives, within each seed by
itself: a seed's own ease or difficulty counts for nothing, and no distribution is assumed.

Without any change, the whole row gives a false change point in at most ALPHA of all cases: only
where the first split is supported are there others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.measure.comparison import ALPHA, PERMUTATIONS
from pytest_simbench.measure.intervals import SEED

FloatArray = NDArray[np.float64]

AT_ONCE = 2_000_000
"""Numbers that are permuted at once, which bounds the memory."""


@dataclass(frozen=True)
class ChangePoint:
    """A place where the mean changed.

    Attributes:
        place: of the first item after the change.
        before, after: means between this change and the ones next to it, of the seeds that have a
            value on both sides, where there are some.
        p_value: probability of such a split without a change, corrected for the number of rows.
    """

    place: int
    before: float
    after: float
    p_value: float


def change_points(values: Sequence[Mapping[int, float]], *, rows: int = 1) -> list[ChangePoint]:
    """The supported change points of a row, in order.

    Args:
        values: of each item (release) by seed; seeds may be missing.
        rows: that are searched together (metrics, tests); each p value is multiplied by it.
    """
    seeds = sorted({seed for found in values for seed in found})
    if len(values) < 2 or not seeds:
        return []
    table = np.array([[found.get(seed, np.nan) for seed in seeds] for found in values])
    p_values: dict[int, float] = {}
    _search(table, 0, len(table), rows, p_values)
    ends = [0, *sorted(p_values), len(table)]
    parts = [table[start:stop] for start, stop in pairwise(ends)]
    return [
        ChangePoint(place, *_means(*sides), p_values[place])
        for place, sides in zip(ends[1:-1], pairwise(parts), strict=True)
    ]


def _means(first: FloatArray, second: FloatArray) -> tuple[float, float]:
    """Of the seeds that both have, if there are some: seeds have levels of their own."""
    both = np.isfinite(first).any(axis=0) & np.isfinite(second).any(axis=0)
    if not both.any():
        return float(np.nanmean(first)), float(np.nanmean(second))
    before, after = (np.nanmean(side[:, both], axis=0).mean() for side in (first, second))
    return float(before), float(after)


def steps(values: Sequence[Mapping[int, float]]) -> list[ChangePoint]:
    """Every change of a row of items that have one value each, which nothing leaves to chance."""
    levels = [next(iter(found.values())) for found in values]
    pairs = enumerate(pairwise(levels), start=1)
    return [ChangePoint(place, *pair, 0.0) for place, pair in pairs if pair[0] != pair[1]]


def _search(table: FloatArray, start: int, stop: int, rows: int, found: dict[int, float]) -> None:
    """Put the change points between two rows of the table into `found`, with their p values."""
    part = table[start:stop]
    part = part[:, np.isfinite(part).any(axis=0)]
    if len(part) < 2 or not part.size:
        return
    part = part - np.nanmean(part, axis=0)
    shifts = _shifts(part[None])[0]
    largest = float(shifts.max())
    scale = float(np.nanmax(np.abs(part)))
    if scale == 0.0:
        return
    p_value = min(1.0, rows * _chance(part, largest - 1e-9 * scale))
    if p_value > ALPHA:
        return
    place = start + 1 + int(shifts.argmax())
    found[place] = p_value
    _search(table, start, place, rows, found)
    _search(table, place, stop, rows, found)


def _shifts(tables: FloatArray) -> FloatArray:
    """The weighted difference of means at each split of tables (n, items, seeds): (n, items - 1).

    Where a side holds no value it is 0.
    """
    known = np.isfinite(tables)
    sums = np.where(known, tables, 0.0).sum(axis=2).cumsum(axis=1)
    counts = known.sum(axis=2).cumsum(axis=1).astype(float)
    first, total = counts[:, :-1], counts[:, -1:]
    second = total - first
    with np.errstate(divide="ignore", invalid="ignore"):
        difference = (sums[:, -1:] - sums[:, :-1]) / second - sums[:, :-1] / first
        weighted = np.abs(difference) * np.sqrt(first * second / total)
    found: FloatArray = np.nan_to_num(weighted, nan=0.0, posinf=0.0)
    return found


def _chance(part: FloatArray, largest: float) -> float:
    """How often permuting gives a split as large."""
    rng = np.random.default_rng(SEED)
    several = max(1, min(PERMUTATIONS, AT_ONCE // part.size))
    as_large, done = 0, 0
    while done < PERMUTATIONS:
        number = min(several, PERMUTATIONS - done)
        tables = rng.permuted(np.broadcast_to(part, (number, *part.shape)), axis=1)
        as_large += int((_shifts(tables).max(axis=1) >= largest).sum())
        done += number
    return (as_large + 1) / (PERMUTATIONS + 1)
