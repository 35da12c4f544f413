"""What differs between simulators: one list, computed once, that every report draws.

Outcomes and costs are two families: costs nearly always differ, and what they show must not make a
difference of outcomes easier to find. In each family a difference between two equal sides is called
one in at most 5 % of all runs, whatever the other sides do (the family-wise error, strongly). All
pairs and metrics are tested together: each seed's differences change their signs together, which
keeps how metrics and pairs hang together, and the largest statistic of those that are still in the
family is what an observed one is held against (step-down max-T: Romano and Wolf 2005, Exact and
approximate stepdown methods for multiple hypothesis testing, JASA 100). The statistic of pairs with
the differences d is |sum d| / sqrt(sum d^2). k pairs cannot bring it above sqrt(k), so that few
pairs, or many that are tied, never carry a verdict. `benchmarks/false_wins.py` measures all this.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from statistics import fmean
from typing import Any, Literal

import numpy as np

from pytest_simbench.measure.comparison import ALPHA, MARGIN, PERMUTATIONS, FloatArray, alike
from pytest_simbench.measure.intervals import SEED, varies
from pytest_simbench.measure.speed import POWER, control, evened
from pytest_simbench.records.metrics import COSTS, CRASHED, Metric
from pytest_simbench.records.record import Record

Family = Literal["outcome", "cost"]
Verdict = Literal["better", "worse", "different", "equivalent", "undecided"]

COMPARED_COSTS = ("cpu_cost", "ram")
"""Of the costs those that belong to the simulator alone: the others hold planning, start-up, or the
machine's load. `cpu_cost` is compared as on a machine of one speed, see `speed`, or not at all."""

GUARD = 0.8
"""Of alpha, what the signs may use. They are exact for a pair, but keep how three and more sides
hang together only roughly where seeds are few: with all of alpha 6 % were measured of 20 seeds."""

MANY_SEEDS = 1000
"""Beyond so many a tenth of the permutations must do: p is then told to 0.007 at 0.05."""

ROOM = 10**7
"""Numbers that one block of permutations takes."""


@dataclass(frozen=True)
class Difference:
    """Two sides at one metric.

    Attributes:
        a, b: keys of the two sides.
        verdict: what `a` is, held against `b`. `different`: no direction is right. `equivalent`:
            within `comparison.MARGIN`.
        first, second: means of a and b over `pairs`, of a metric with a reference those of the
            distances from it; nan without a pair.
        low, high: 95 % interval of second - first, which holds for all of the family together; None
            where the pairs tell none.
        p_value: probability that such a difference is called one anywhere between equal sides.
        pairs: seeds at which both sides have a value.
        seeds: seeds that came to an end on both; the others of them crashed, or have no value.
        differ: pairs that differ by more than the metric's resolution.
        needs: where nothing can be certain yet, how many pairs must differ at least; else 0.
    """

    a: Any
    b: Any
    metric: Metric
    family: Family
    verdict: Verdict
    first: float
    second: float
    low: float | None
    high: float | None
    p_value: float
    pairs: int
    seeds: int
    differ: int
    needs: int = 0

    @property
    def winner(self) -> Any:
        """The side that is better; None where neither is."""
        return {"better": self.a, "worse": self.b}.get(self.verdict)

    @property
    def loser(self) -> Any:
        """The side that is worse; None where neither is."""
        return {"better": self.b, "worse": self.a}.get(self.verdict)


def differences(
    sides: Mapping[Any, Sequence[Record]],
    metrics: Iterable[Metric],
    comparable: Callable[[Any, Any], bool] = lambda a, b: True,
    references: Mapping[str, float] | None = None,
) -> list[Difference]:
    """Every pair of sides at every metric that both have, paired by seed.

    A crashed repetition counts with the worst value where the metric has one (`Record.value`). Of
    other metrics the repetitions with a value are compared, and where the better side has none,
    that counts as the largest loss seen: nobody wins by those that survive. Pairs within the
    metric's resolution are equal. A side whose values vary by no more than it, or that more
    repetitions would not change (`Notes.sole`), is one value, and a mean difference within it none.

    Args:
        sides: records by side: simulator, mode, profile.
        metrics: of the task; crashes, CPU cost and memory are compared besides.
        comparable: which pairs are of interest.
        references: the right value of metrics without a good direction; nearer is better.
    """
    judged, given = list(metrics), references or {}
    own = {metric.name for metric in judged}
    costs = [m for m in COSTS if m.name in COMPARED_COSTS and m.name not in own]
    families: dict[Family, list[Metric]] = {"outcome": [CRASHED, *judged], "cost": costs}
    pairs = [pair for pair in combinations(sides, 2) if comparable(*pair)]
    ended = {key: [r for r in found if r.status != "interrupted"] for key, found in sides.items()}
    sole = {key for key, found in ended.items() if any(r.notes.sole for r in found)}
    result: list[Difference] = []
    for family, of in families.items():
        tests = []
        for metric in of:
            right = given.get(metric.name) if metric.better is None else None
            values = {key: _off(found, right) for key, found in _values(ended, metric).items()}
            known = metric if right is None else replace(metric, better="lower")
            tests += [_Pair(a, b, known, values[a], values[b]) for a, b in pairs]
        for test in tests:
            test.one_value |= not sole.isdisjoint((test.a, test.b))
        result += _judged(family, [test for test in tests if test.common])
    return result


Values = Mapping[int, float | None]
"""By seed, of each repetition that came to an end; None where it has no value."""


def _values(ended: Mapping[Any, Sequence[Record]], metric: Metric) -> dict[Any, Values]:
    """By side."""
    found: dict[Any, Values] = {
        key: {r.seed: r.value(metric) for r in records} for key, records in ended.items()
    }
    if metric in COSTS and metric.name in POWER:
        done = {key: [r for r in records if r.ok] for key, records in ended.items()}
        times = [t for records in done.values() for r in records if (t := control(r, metric.name))]
        usual = fmean(times) if times else 0.0
        even = {key: evened(records, metric.name, usual) or {} for key, records in done.items()}
        found = {key: dict.fromkeys(found[key]) | even[key] for key in ended}
    return found


def _off(values: Values, right: float | None) -> Values:
    """How far from the right value, where there is one."""
    if right is None:
        return values
    return {seed: None if v is None else abs(v - right) for seed, v in values.items()}


class _Pair:
    """Two sides at one metric, before the other tests of the family are known.

    Attributes:
        seeds: that ended on both sides.
        common: those at which both have a value.
        gaps: second - first by seed; 0 within the resolution.
        column: the same with what speaks against the better side because it has no value there.
    """

    def __init__(self, a: Any, b: Any, metric: Metric, first: Values, second: Values) -> None:
        self.a, self.b, self.metric = a, b, metric
        self.seeds = sorted(first.keys() & second.keys())
        known = {s: (x, y) for s in self.seeds if (x := first[s]) is not None
                 and (y := second[s]) is not None}  # fmt: skip
        self.common = list(known)
        self.sides = np.array([*known.values()], dtype=float).reshape(-1, 2)
        resolution = max(metric.smallest_difference, 1e-12 * np.abs(self.sides).max(initial=1.0))
        gaps = self.sides[:, 1] - self.sides[:, 0]
        gaps[np.abs(gaps) <= resolution] = 0.0
        self.gaps = gaps
        self.one_value = metric.smallest_difference > 0 and not all(
            varies(list(side), metric) for side in self.sides.T
        )
        self.column = dict(zip(self.common, gaps, strict=True))
        total = float(gaps.sum())
        if metric.better is not None and total:
            better = second if (total > 0) == (metric.better == "higher") else first
            other = first if better is second else second
            against = -math.copysign(float(np.abs(gaps).max()), total)
            self.column |= {
                s: against for s in self.seeds if better[s] is None and other[s] is not None
            }

    @property
    def difference(self) -> float:
        """Of the means."""
        return float(self.sides[:, 1].mean() - self.sides[:, 0].mean())

    def verdict(self, total: float) -> Verdict:
        """That of the first side, where the statistic is not of chance.

        Args:
            total: sum of what speaks for a larger second side.
        """
        found = self.difference
        beyond = abs(found) > self.metric.smallest_difference and found * total > 0
        if self.one_value or not beyond:
            return "undecided"
        if self.metric.better is None:
            return "different"
        return "worse" if (found > 0) == (self.metric.better == "higher") else "better"

    def equivalent(self) -> bool:
        whole = len(self.common) == len(self.seeds) > 1 and self.metric.bounded
        first, second = self.sides.T
        return whole and alike(first, second, MARGIN, yes_no=self.metric.kind == "yes_no")


def _judged(family: Family, tests: Sequence[_Pair]) -> list[Difference]:
    """All tests of a family together."""
    if not tests:
        return []
    seeds = sorted({seed for test in tests for seed in test.column})
    columns = np.array([[test.column.get(s, 0.0) for test in tests] for s in seeds])
    centred = columns - columns.mean(0)
    for place, test in enumerate(tests):
        mean = test.gaps.mean()
        own = dict(zip(test.common, test.gaps - mean, strict=True))
        centred[:, place] = [own.get(s, 0.0) for s in seeds]
    usable = np.array([not test.one_value for test in tests])
    scaled = _scaled(columns) * usable
    p_values, bound = step_down(scaled)
    reach = step_down(_scaled(centred) * usable)[1]
    found = []
    for test, p, column in zip(tests, p_values, scaled.T, strict=True):
        verdict = test.verdict(float(column.sum())) if p <= ALPHA else "undecided"
        if verdict == "undecided" and test.equivalent():
            verdict = "equivalent"
        differ = int(np.count_nonzero(test.gaps))
        needs = 0
        if verdict == "undecided" and not test.one_value and np.abs(column).sum() <= bound + 1e-9:
            needs = max(FEWEST_THAT_DIFFER, math.floor(bound**2 + 1e-9) + 1, differ + 1)
        low, high = _interval(test, reach, decided=verdict not in ("undecided", "equivalent"))
        first, second = map(float, test.sides.mean(0))
        found.append(
            Difference(
                test.a, test.b, test.metric, family, verdict, first, second, low, high, float(p),
                len(test.common), len(test.seeds), differ, needs,
            )
        )  # fmt: skip
    return found


FEWEST_THAT_DIFFER = 1 + math.ceil(math.log2(1 / ALPHA))
"""Pairs that must differ, all in one direction, for the smallest p value to be ALPHA: 6."""


def _scaled(columns: FloatArray) -> FloatArray:
    """Columns of length 1, so that a sum with any signs is the statistic; those of 0 stay so."""
    length = np.sqrt((columns**2).sum(0))
    return columns / np.where(length > 0, length, 1.0)


def step_down(columns: FloatArray) -> tuple[FloatArray, float]:
    """Adjusted p values of columns (seeds, tests) of length 1, and what none of all statistics
    exceeds but with probability `ALPHA` if no sides differ."""
    observed = np.round(np.abs(columns.sum(0)), 9)
    order = np.argsort(-observed, kind="stable")
    beyond, largest, count = np.zeros(len(order)), [], 0
    for signs in _signs(len(columns), len(order)):
        drawn = np.round(np.abs(signs @ columns[:, order]), 9)
        # Of each test the largest statistic among itself and those that are less striking.
        drawn = np.maximum.accumulate(drawn[:, ::-1], axis=1)[:, ::-1]
        beyond += (drawn >= observed[order]).sum(0)
        largest.append(drawn[:, 0])
        count += len(drawn)
    p_values = np.empty(len(order))
    p_values[order] = np.minimum(1, np.maximum.accumulate(beyond / count) / GUARD)
    tail = np.sort(np.concatenate(largest))[::-1]
    return p_values, float(tail[min(math.floor(GUARD * ALPHA * count), count - 1)])


def _signs(seeds: int, tests: int) -> Iterator[FloatArray]:
    """Signs of the seeds (n, seeds), those observed first: all that differ, or random ones."""
    if 2 ** (seeds - 1) <= PERMUTATIONS:  # the first sign does not matter
        codes = np.arange(2 ** (seeds - 1))[:, None] >> np.arange(seeds)[None, :]
        yield np.asarray(1.0 - 2.0 * (codes & 1), dtype=float)
        return
    rng = np.random.default_rng(SEED)
    left = PERMUTATIONS if seeds <= MANY_SEEDS else PERMUTATIONS // 10
    yield np.ones((1, seeds))
    while left > 0:
        block = min(left, max(1, ROOM // max(seeds, tests)))
        yield np.asarray(1 - 2 * rng.integers(0, 2, (block, seeds), dtype=np.int8), dtype=float)
        left -= block


def _interval(test: _Pair, reach: float, *, decided: bool) -> tuple[float | None, float | None]:
    """The differences that the same statistic, of the gaps less a difference, does not reject.

    None where all pairs have one gap, which is no spread, or are too few. Where stepping down
    decided what one step does not, it ends at 0.
    """
    n, mean = len(test.gaps), float(test.gaps.mean())
    spread = float(((test.gaps - mean) ** 2).sum())
    if test.one_value or n <= reach**2 + 1e-9 or spread <= 1e-18 * max(1.0, mean * mean):
        return None, None
    half = reach * math.sqrt(spread / (n * (n - reach**2)))
    low, high = mean - half, mean + half
    if decided:
        low, high = (max(low, 0.0), high) if mean > 0 else (low, min(high, 0.0))
    if test.metric.bounded:
        low, high = max(low, -1.0), min(high, 1.0)
    return low, high
