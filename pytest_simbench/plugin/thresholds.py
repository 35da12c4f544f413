"""Is every metric of `--sim-threshold` one that a threshold can be of, and can it fail?"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from types import CodeType

import pytest

from pytest_simbench.plugin import options


def problem(config: pytest.Config, items: Iterable[pytest.Item]) -> str:
    """What is wrong with `--sim-threshold`, once the tests are known; else nothing.

    Valid are the metrics of our own tasks, the costs, `failures`, and every name that stands in the
    code or the parameters of a collected test that asks for a `threshold`: tests of other packages
    have metrics of their own. The ini file, which holds for tests that were not collected this
    time too, is not checked.
    """
    if not options.given(config, "sim_threshold"):
        return ""
    asking = [item for item in items if "threshold" in getattr(item, "fixturenames", ())]
    given = options.value(config, "sim_threshold")
    unknown = given.keys() - {text for item in asking for text in _texts(item)}
    from pytest_simbench.measure.limits import FAILURES, LimitError, check_gate
    from pytest_simbench.repeatability.stability import KEPT
    from pytest_simbench.tasks import Stacking, Throwing
    from pytest_simbench.tasks.metrics import COSTS, Metric, UnknownMetric

    tasks = (Stacking(), Throwing())
    all_metrics = (*COSTS, FAILURES, KEPT, *(m for task in tasks for m in task.metrics))
    known = {metric.name: metric for metric in all_metrics}
    for name in sorted(unknown - known.keys()):
        return f"--sim-threshold={name}={given[name]:g}: {UnknownMetric(name, known)}"
    for name, value in given.items():
        try:
            check_gate(known.get(name, Metric(name, name, better=None)), value)
        except LimitError as error:
            return f"--sim-threshold={name}={value:g}: {error}"
    return ""


def _texts(item: pytest.Item) -> Iterator[str]:
    """The texts in a test's code and parameters; a metric's name is one of them."""
    parameters = getattr(getattr(item, "callspec", None), "params", {})
    yield from (value for value in parameters.values() if isinstance(value, str))
    code = getattr(getattr(item, "function", None), "__code__", None)
    yield from _constants(code) if code else ()


def _constants(code: CodeType) -> Iterator[str]:
    for constant in code.co_consts:
        if isinstance(constant, str):
            yield constant
        elif isinstance(constant, CodeType):
            yield from _constants(constant)
