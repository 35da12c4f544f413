"""Many repetitions' values as one: mean, deviation and interval; and what was sampled."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from pytest_simbench.measure.intervals import interval
from pytest_simbench.records.metrics import COSTS, Metric

COST = {cost.name: cost for cost in COSTS}

SAMPLED = {"cpu": "cpu_percent", "ram": "rss_mb"}
"""Costs that are sampled, and how records call them among their resources."""


@dataclass(frozen=True)
class Spread:
    """A number over the repetitions of a row.

    Attributes:
        count: repetitions that have it.
        std: deviation between repetitions, and within them where it was sampled; 0 for one value.
        low, high: the 95 % interval of the mean, or None where too few repetitions tell one.
        peak: the largest value that was sampled.
    """

    count: int
    min: float
    mean: float
    max: float
    std: float
    low: float | None
    high: float | None
    peak: float | None = None


def spread(values: Iterable[float | None], metric: Metric | None = None) -> Spread | None:
    """Smallest, mean and largest of the values that are there, with the interval of the mean, which
    is the one that the assertions use (`measure.intervals`).

    Without a metric no interval is computed, nor where a share lies outside 0..1 or a value below
    its least: a report shows a wrong record rather than fail on it.
    """
    found = [float(value) for value in values if value is not None and math.isfinite(value)]
    if not found:
        return None
    low: float | None = None
    high: float | None = None
    if metric is not None and all(map(metric.holds, found)):
        told = interval(found, metric)
        if math.isfinite(told.low) and math.isfinite(told.high):
            low, high = told.low, told.high
    std = statistics.stdev(found) if len(found) > 1 else 0.0
    return Spread(len(found), min(found), statistics.fmean(found), max(found), std, low, high)


def pooled(resources: Iterable[Mapping[str, Any]], cost: str) -> Spread | None:
    """Mean and deviation of a cost that was sampled (`cpu`, `ram`); repetitions count the same.

    So the mean is that of the repetitions' means, whose interval is shown, however many samples a
    repetition has. The deviation is within and between repetitions: with means m_i and deviations
    s_i the variance is the mean of s_i^2 + (m_i - m)^2.
    """
    parts, peaks = [], []
    for use in resources:
        found = use.get(SAMPLED[cost]) or {}
        mean, count = found.get("mean"), use.get("samples") or 0
        if mean is not None and count > 0:
            parts.append((mean, found.get("std") or 0.0))
        if found.get("peak") is not None:
            peaks.append(float(found["peak"]))
    over = spread([mean for mean, _ in parts], COST[cost])
    if over is None:
        return None
    variance = statistics.fmean(std**2 + (mean - over.mean) ** 2 for mean, std in parts)
    return replace(over, std=math.sqrt(variance), peak=max(peaks, default=None))


def pooled_by_phase(resources: Sequence[Mapping[str, Any]]) -> dict[str, tuple[Spread, Spread]]:
    """CPU [% of a core] and RAM [MB] in each phase that was sampled, in order of appearance."""
    phases = [use.get("phases") or {} for use in resources]
    found = {}
    for name in merged_order(phases):
        parts = [use[name] for use in phases if name in use]
        cpu, memory = (pooled(parts, cost) for cost in SAMPLED)
        if cpu is not None and memory is not None:
            found[name] = (cpu, memory)
    return found


def merged_order(sequences: Iterable[Iterable[str]]) -> list[str]:
    """Every name once; one that a later sequence adds comes after the name that it follows there.

    Short phases are not sampled in every repetition.
    """
    order: list[str] = []
    for names in sequences:
        place = 0
        for name in names:
            if name not in order:
                order.insert(place, name)
            place = order.index(name) + 1
    return order
