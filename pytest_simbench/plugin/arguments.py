"""What a test gives our fixtures, checked before anything runs: one sentence, and no traceback."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any, NoReturn

import pytest

from pytest_simbench.cli.values import ANY_NUMBER, BadInput, BadValue, refusing, shown

if TYPE_CHECKING:
    from pytest_simbench.cli.selection import Selection
    from pytest_simbench.experiment.experiment import Experiment
    from pytest_simbench.experiment.variants import Variant
    from pytest_simbench.tasks.base import Task


_failure = partial(pytest.fail.Exception, pytrace=False)

failing = partial(refusing, kind=_failure)
"""Fails the test in place of errors in a block, with their sentences alone."""


def refuse(sentence: str) -> NoReturn:
    """Fail the test with this sentence alone."""
    raise _failure(sentence)


def checked_task(value: Any, fixture: str) -> Task:
    """`value` if it is a task; else the test fails. `fixture` is the one that it was given."""
    from pytest_simbench.cli import selection

    with failing(BadInput):
        return selection.checked_task(value, fixture)


def can_do(experiment: Experiment, skips: bool) -> Experiment:
    """An experiment whose robot can do the task; else the test fails before anything runs.

    With `skips` it is skipped instead, since nobody named the robot (`--robot=all`); so is that of
    a task without a robot, but for the first robot's.
    """
    problem = experiment.problem()
    if skips and problem:
        pytest.skip(f"--robot=all: {problem}")
    if problem:
        refuse(f"--robot: {problem}")
    if skips and experiment.case.robot is not None and experiment.robot is None:
        pytest.skip(f"--robot=all: the task {experiment.task.name!r} has no robot, and ran once")
    return experiment


def checked_settings(value: Any, of: Variant, chosen: Selection) -> dict[str, Any]:
    """What the fixture `sim_settings` gives, if the simulator can take it; else the test fails."""
    from pytest_simbench.ground.errors import SettingsError

    if not isinstance(value, Mapping):
        refuse(
            f"the fixture sim_settings gives {shown(repr(value))}; it must give a dict of settings "
            "by name, {'timestep': 0.001} for instance"
        )
    with failing(SettingsError, "the fixture sim_settings"):
        chosen.settings(of.simulator, of.profile, value)
    return dict(value)


def checked_threshold(metric: Any, default: Any) -> float:
    """The suite's own threshold of a metric, if both are what they must be; else the test fails."""
    if not isinstance(metric, str) or not metric:
        refuse(f"threshold({shown(repr(metric))}, ...) takes the name of a metric as a text")
    with suppress(BadValue):
        return float(ANY_NUMBER.check(default))
    refuse(f"threshold({metric!r}, {shown(repr(default))}) takes a finite number")
