"""Is every metric of `--sim-threshold` one that a threshold can be of, and can it fail?

What the tests measure is known when they have described it: a name that nobody knows is told at the
end of the run, a value that can never fail as soon as the kind of its metric is known.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import pytest

from pytest_simbench.measure.limits import LimitError, check_gate, named
from pytest_simbench.plugin import options
from pytest_simbench.records.folder import RunContents
from pytest_simbench.records.metrics import COSTS, CRASHED, Metric, UnknownMetric
from pytest_simbench.repeatability.stability import KEPT

OF_EVERY_TASK = (*COSTS, CRASHED, KEPT)
"""What thresholds may be of besides the metrics of tasks."""


def typed(config: pytest.Config) -> dict[str, float]:
    """The thresholds of `--sim-threshold`, by the names that metrics have now."""
    given = options.value(config, "sim_threshold")
    return {named(name): float(value) for name, value in given.items()}


def bad_value(given: Mapping[str, float], metrics: Iterable[Metric] = OF_EVERY_TASK) -> str:
    """A sentence when a threshold of one of these metrics cannot be, or can never fail."""
    for metric in metrics:
        try:
            if metric.name in given:
                check_gate(metric, given[metric.name])
        except LimitError as error:
            return f"{_typed(metric.name, given)}: {error}"
    return ""


def problem(given: Mapping[str, float], run: RunContents, passed: bool) -> str:
    """What is wrong with thresholds, once the tests have run; else nothing.

    Valid are the metrics of the tasks that were performed, the costs, `crashed`, and every name
    that a test asked a threshold of; where all tests passed, and so asked for all of theirs, only
    the last.
    """
    metrics = [*OF_EVERY_TASK, *(m for found in run.metrics.values() for m in found)]
    asked = {threshold.metric for threshold in run.thresholds}
    known = {metric.name for metric in metrics} | asked
    for name in sorted(given.keys() - known):
        return f"{_typed(name, given)}: {UnknownMetric(name, known)}"
    for name in sorted(given.keys() - asked) * passed:
        told = f"no test that ran asks for it; in a test, the fixture threshold({name!r}, ...) does"
        return f"{_typed(name, given)}: {told}"
    return bad_value(given, metrics)


def _typed(name: str, given: Mapping[str, float]) -> str:
    return f"--sim-threshold={name}={given[name]:g}"
