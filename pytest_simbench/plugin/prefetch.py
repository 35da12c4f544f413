"""Which repetitions may begin before their test: those of tests that say what they will repeat, by
`@pytest.mark.repeats("PARAMETER")`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import pytest

from pytest_simbench.plugin import cluster, options

if TYPE_CHECKING:
    from pytest_simbench.experiment.case import Case
    from pytest_simbench.experiment.experiment import Experiment
    from pytest_simbench.plugin.variants import Variant

    CaseOf = Callable[[pytest.Config, Variant, pytest.Item, dict[str, Any]], Case]

MARK = "repeats"


def expected(
    config: pytest.Config, items: Iterable[pytest.Item], case_of: CaseOf
) -> list[Experiment]:
    """What tests will ask for, in their order; empty where nothing may begin before its test.

    Args:
        config: of the run.
        items: its tests.
        case_of: gives the case of a test of a variant that changes no settings.
    """
    alone = not hasattr(config, "workerinput") and not cluster.asked(config)
    again = options.given(config, "sim_resume")
    if not alone or again or options.value(config, "sim_jobs") < 2:
        return []
    return [experiment for item in items for experiment in _of(item, case_of)]


def _of(item: pytest.Item, case_of: CaseOf) -> Iterator[Experiment]:
    """The experiment of a test of one repetition, if it tells and runs without a window."""
    from pytest_simbench.experiment.experiment import Experiment
    from pytest_simbench.plugin.marks import number_mark
    from pytest_simbench.plugin.variants import Variant
    from pytest_simbench.simulator import SimulatorError
    from pytest_simbench.tasks.base import Task

    mark, chosen = item.get_closest_marker(MARK), getattr(item, "callspec", None)
    if mark is None or chosen is None or item.get_closest_marker("skip") is not None:
        return
    variant, task = chosen.params.get("sim_case"), chosen.params.get(*mark.args[:1] or [""])
    if not isinstance(task, Task):
        pytest.fail(
            f"{item.nodeid}: {MARK} needs the name of a parameter that holds a task; "
            f"choose from {', '.join(name for name in chosen.params if name != 'sim_case')}",
            pytrace=False,
        )
    if not isinstance(variant, Variant) or variant.mode == "gui" or variant.robot:
        return
    if (options.value(item.config, "sim_reps") or number_mark(item, "reps")) == 1:
        with suppress(SimulatorError):  # its test tells
            yield Experiment(case_of(item.config, variant, item, {}), task)
