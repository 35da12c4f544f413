"""Which simulator beats which, on which metric: all pairs tested, corrected for their number."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

from pytest_simbench.measure.comparison import ALPHA, MeanDifference, compare_by_seed
from pytest_simbench.measure.intervals import FEWEST, varies
from pytest_simbench.measure.limits import FAILURES
from pytest_simbench.records.metrics import COSTS, Metric
from pytest_simbench.records.record import Record

COMPARED_COSTS = ("rtf", "cpu_cost", "ram")
"""Of the costs those that belong to the simulator alone: the others hold planning and start-up."""


@dataclass(frozen=True)
class Win:
    """One side is better at one metric, and not by chance.

    Attributes:
        winner, loser: keys of the two sides.
        metric: at which.
        comparison: of the loser with the winner: difference, test, p value before correction.
        p_value: corrected.
    """

    winner: Any
    loser: Any
    metric: Metric
    comparison: MeanDifference
    p_value: float


def wins(
    sides: Mapping[Any, Sequence[Record]],
    metrics: Iterable[Metric],
    comparable: Callable[[Any, Any], bool] = lambda a, b: True,
    alpha: float = ALPHA,
) -> list[Win]:
    """Every metric on which one side beats another.

    Each pair is tested at each metric that has a good direction, two-sided, paired by seed where
    both sides ran the same seeds. Nothing is tested with fewer than `FEWEST` values on a side, nor
    with a side whose values vary by no more than the metric's resolution: they are one value, many
    times; and no smaller difference is won. Of the wins at most `alpha` are expected to be chance
    (Benjamini and Hochberg's false-discovery rate), and where no side differs, a run without any
    win is had with a probability of 1 - `alpha`.

    Args:
        sides: records by side: simulator, mode, profile.
        metrics: of the task; failures, speed, CPU cost and memory are compared besides.
        comparable: which pairs are of interest.
        alpha: see above.
    """
    from scipy.stats import false_discovery_control

    judged = [FAILURES, *(m for m in metrics if m.better)]
    judged += [
        m for m in COSTS if m.name in COMPARED_COSTS and m.name not in {j.name for j in judged}
    ]
    values = {(key, m.name): _values(run, m) for key, run in sides.items() for m in judged}
    found: list[tuple[Any, Any, Metric, MeanDifference]] = []
    pairs = [pair for pair in combinations(sides, 2) if comparable(*pair)]
    testable = {(key, m.name) for key in sides for m in judged if _testable(values[key, m.name], m)}
    for (a, b), metric in ((p, m) for p in pairs for m in judged):
        first, second = (a, metric.name), (b, metric.name)
        if first in testable and second in testable:
            found.append((a, b, metric, compare_by_seed(values[first], values[second])))
    if not found:
        return []
    corrected = false_discovery_control([c.p_value for *_, c in found])
    result = []
    for (a, b, metric, comparison), p in zip(found, corrected, strict=True):
        if p <= alpha and abs(comparison.difference) > metric.smallest_difference:
            second_wins = (comparison.difference > 0) == (metric.better == "higher")
            winner, loser = (b, a) if second_wins else (a, b)
            result.append(Win(winner, loser, metric, comparison, float(p)))
    return result


def _testable(values: Mapping[int, float], metric: Metric) -> bool:
    if len(values) < FEWEST:
        return False
    return metric.smallest_difference == 0 or varies([*values.values()], metric)


def _values(records: Sequence[Record], metric: Metric) -> dict[int, float]:
    """The metric's values by seed; of failures every repetition that came to an end has one."""
    if metric.name == FAILURES.name:
        return {r.seed: float(not r.ok) for r in records if r.status != "interrupted"}
    cost = metric.name in COMPARED_COSTS and all(metric.name not in r.metrics for r in records)
    found = {
        r.seed: r.cost(metric.name) if cost else r.metrics.get(metric.name) for r in records if r.ok
    }
    return {seed: float(value) for seed, value in found.items() if value is not None}
