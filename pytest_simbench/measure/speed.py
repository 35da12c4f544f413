"""The machine's speed taken out of times, so that a slow or busy machine fails no build.

Beside each repetition the worker ran a control workload, always the same (`worker.control`). A time
is divided by the control's, a real-time factor multiplied, both relative to the baseline's usual
one: a machine half as fast has half the real-time factor, and the control takes twice as long.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from pytest_simbench.measure.comparison import Alternative, MeanDifference, compare_by_seed
from pytest_simbench.measure.results import ResultSet
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.record import Record

Values = dict[int, float]
"""A value for each seed."""

POWER = {"rtf": 1, "cpu_cost": -1, "start": -1, "end": -1, "total": -1}
"""Costs that depend on the machine's speed: the power of the control's time that evens them out."""


def without_speed(name: str, before: ResultSet, after: ResultSet) -> tuple[Values, Values] | None:
    """A cost's values in two runs as on a machine of the same speed.

    `rtf` is freed of the time in which the stepping thread waited for a processor, too, and divided
    by the control's time without such waiting: both are known exactly. The costs that hold more
    than stepping (`start`, `end`, `total`) are compared with the control as it was interrupted,
    which evens out over many repetitions only.

    Returns:
        None where the cost does not depend on speed, or a repetition has no control.
    """
    if name not in POWER or name in after.metrics or not before.ok:
        return None
    usual = math.fsum(control(r, name) for r in before.ok) / len(before.ok) or 1.0
    first, second = (evened(side.ok, name, usual) for side in (before, after))
    return None if first is None or second is None else (first, second)


def compared(
    metric: Metric,
    before: ResultSet,
    after: ResultSet,
    *,
    both_ways: bool = False,
    permutations: int = 0,
) -> tuple[MeanDifference, bool]:
    """Whether a metric is worse in the second run than in the first (`both_ways`: another one), by
    seed; and whether the machine's speed was taken out. `permutations`: see `comparison.compare`.

    Raises:
        ValueError: a side has no value.
    """
    even = without_speed(metric.name, before, after)
    worse: Alternative = "less" if metric.better == "higher" else "greater"
    found = compare_by_seed(
        *(even or (before.by_seed(metric), after.by_seed(metric))),
        "two-sided" if both_ways else worse,
        sole=before.sole(metric) and after.sole(metric),
        permutations=permutations,
    )
    return found, even is not None


def evened(records: Sequence[Record], name: str, usual: float) -> Values | None:
    """A cost's values on a machine whose control takes `usual` seconds; None where a repetition has
    no control, or none is there."""
    speeds = [control(record, name) for record in records]
    if not speeds or not all(speeds):
        return None
    return {
        r.seed: value * (speed / usual) ** POWER[name]
        for r, speed in zip(records, speeds, strict=True)
        if (value := _value(r, name)) is not None
    }


def control(record: Record, name: str) -> float:
    """Seconds of the control workload that a cost is to be compared with; 0 where not recorded."""
    stepping = record.stepping
    if name == "cpu_cost":
        return stepping.get("control_cpu") or 0.0
    wall = stepping.get("control_wall") or 0.0
    return max(0.0, wall - (stepping.get("control_waited") or 0.0)) if name == "rtf" else wall


def _value(record: Record, name: str) -> float | None:
    value, wall = record.cost(name), record.stepping.get("wall")
    if name != "rtf" or value is None or not wall:
        return value
    alone = wall - (record.stepping.get("waited") or 0.0)
    return value * wall / alone if alone > 0 else value
