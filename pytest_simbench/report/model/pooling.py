"""Many repetitions' values as one: smallest, mean and largest; and what was sampled."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pytest_simbench.measure.intervals import interval
from pytest_simbench.records.metrics import Metric

Ends = Callable[[Sequence[float], Metric], tuple[float, float]]
"""Gives the lower and upper end of the interval of a metric's mean; infinite where not known."""

AMOUNT = Metric("amount", "any cost", least=0.0)
"""For the intervals of what is not a share."""


@dataclass(frozen=True)
class Spread:
    """A number over the repetitions of a row.

    Attributes:
        count: repetitions that have it.
        std: deviation between repetitions; 0 for a single one.
        low, high: the 95 % interval of the mean, or None where too few repetitions tell one.
    """

    count: int
    min: float
    mean: float
    max: float
    std: float = 0.0
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Sampled:
    """A resource over all repetitions of a row.

    Attributes:
        mean, std: of what was sampled, each repetition counting the same.
        peak: the largest value.
        low, high: the 95 % interval of the mean over the repetitions, None for too few.
    """

    mean: float
    std: float
    peak: float | None = None
    low: float | None = None
    high: float | None = None


def interval_ends(values: Sequence[float], metric: Metric) -> tuple[float, float]:
    """Ends of the 95 % interval that the assertions use, see `measure.intervals`."""
    found = interval(values, metric)
    return found.low, found.high


def spread(
    values: Iterable[float | None], metric: Metric | None = None, ends: Ends = interval_ends
) -> Spread | None:
    """Smallest, mean and largest of the values that are there, with the interval of the mean.

    Without a metric no interval is computed, nor where a share lies outside 0..1 or a value below
    its least: a report shows a wrong record rather than fail on it.
    """
    found = [float(value) for value in values if value is not None and math.isfinite(value)]
    if not found:
        return None
    low: float | None = None
    high: float | None = None
    if metric is not None and _possible(found, metric):
        low, high = ends(found, metric)
        if not (math.isfinite(low) and math.isfinite(high)):
            low = high = None
    std = statistics.stdev(found) if len(found) > 1 else 0.0
    return Spread(len(found), min(found), statistics.fmean(found), max(found), std, low, high)


def _possible(values: Sequence[float], metric: Metric) -> bool:
    if metric.bounded:
        return min(values) >= 0 and max(values) <= 1
    return metric.least is None or min(values) >= metric.least


def pooled(
    resources: Iterable[Mapping[str, Any]], name: str, ends: Ends = interval_ends
) -> Sampled | None:
    """Mean and deviation of what was sampled, each repetition counting the same.

    So the mean is that of the repetitions' means, whose interval is shown, however many samples a
    repetition has. The deviation is within and between repetitions: with means m_i and deviations
    s_i the variance is the mean of s_i^2 + (m_i - m)^2.

    Args:
        resources: of each repetition, as records hold them.
        name: `cpu_percent` or `rss_mb`.
        ends: the interval to show.
    """
    parts = []
    peaks = []
    for use in resources:
        found = use.get(name) or {}
        mean, count = found.get("mean"), use.get("samples") or 0
        if mean is not None and count > 0:
            parts.append((mean, found.get("std") or 0.0))
        if found.get("peak") is not None:
            peaks.append(float(found["peak"]))
    over = spread([mean for mean, _ in parts], AMOUNT, ends)
    if over is None:
        return None
    variance = statistics.fmean(std**2 + (mean - over.mean) ** 2 for mean, std in parts)
    peak = max(peaks, default=None)
    return Sampled(over.mean, math.sqrt(variance), peak, over.low, over.high)


def pooled_by_phase(
    resources: Sequence[Mapping[str, Any]],
) -> dict[str, tuple[Sampled, Sampled]]:
    """CPU [% of a core] and RAM [MB] in each phase that was sampled, in order of appearance."""
    phases = [use.get("phases") or {} for use in resources]
    found = {}
    for name in merged_order(phases):
        parts = [use[name] for use in phases if name in use]
        cpu, memory = (pooled(parts, kind) for kind in ("cpu_percent", "rss_mb"))
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
