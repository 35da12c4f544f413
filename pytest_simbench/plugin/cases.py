"""What the options say of a test's repetitions, and which of them may begin before their test."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest

from pytest_simbench.cli.values import refusing
from pytest_simbench.ground.versions import BUILD
from pytest_simbench.plugin import arguments, cluster, options, recording
from pytest_simbench.plugin.policies import FIXTURE as POLICY
from pytest_simbench.plugin.session import session_of

if TYPE_CHECKING:
    from pytest_simbench.client.display import Displays
    from pytest_simbench.experiment.case import Case
    from pytest_simbench.experiment.experiment import Experiment
    from pytest_simbench.experiment.variants import Variant
    from pytest_simbench.plugin.run import Run

OF_CASES = ("fresh", "stall_timeout", "memory_limit", "seed", "jitter")
"""Options of the same name as an attribute of `Case`, behind `sim_`."""


def case_of(
    config: pytest.Config,
    made_for: Variant,
    item: pytest.Item | None = None,
    settings: Any = None,
) -> Case:
    """What the options say of a simulator's repetitions, and of a test's own.

    Args:
        config: of the run.
        made_for: simulator, mode, profile, time step and robot.
        item: the test; None for the handle that all tests share.
        settings: that the test changes, unchecked.
    """
    from pytest_simbench.experiment.case import PROTOCOLS
    from pytest_simbench.plugin.marks import named, number

    name, mode = made_for.simulator, made_for.mode
    session = session_of(config)
    chosen, this = session.selection, session.run
    elsewhere = cluster.asked(config)  # nodes find interpreters and displays themselves
    timeout = options.value(config, "sim_timeout")
    of_test: dict[str, Any] = {"test": "simulator"}
    own: Mapping[str, Any] = {}
    if item is not None:
        function, others = named(item, made_for.id_with(len(chosen.profiles)))
        of_test = {"test": item.nodeid, "function": function, "variant": others}
        timeout = number(item, "sim_timeout")
        of_test |= {"needs": _needs(item, name)}
        own = arguments.checked_settings(settings, made_for, chosen)
    return chosen.case(
        made_for,
        own,
        folder=this.use(),
        display=_display(this) if mode == "gui" and not elsewhere else None,
        protocol=PROTOCOLS[options.value(config, "sim_protocol")],
        trace=recording.trace_mode(config),
        video=recording.video_mode(config, name),
        timeout=timeout,
        **{name: options.value(config, f"sim_{name}") for name in OF_CASES},
        **of_test,
    )


def _needs(item: pytest.Item, name: str) -> tuple[str, ...]:
    """The options with files of the user's that a test is made of, for pytest's root folder: its
    build of a simulator, its policies, its scene."""
    fixtures = getattr(item, "fixturenames", ())
    policies = options.value(item.config, "sim_policies") if POLICY in fixtures else None
    scene = options.value(item.config, "sim_scene") if "scene_file" in fixtures else None
    found = [(options.from_root(item.config, path), name) for path, name in policies or ()]
    typed = ",".join(f"{path}:{name}" if name else path for path, name in found)
    scene = scene and options.from_root(item.config, scene)
    python = session_of(item.config).selection.pythons.get(name) if BUILD in name else None
    given = {"name": python and f"{name}={python}", "policies": typed, "scene": scene}
    return tuple(f"--sim-{option}={files}" for option, files in given.items() if files)


def _display(this: Run) -> Displays:
    """The displays of a run, if there are any; skips the test where there are none."""
    from pytest_simbench.client.errors import DisplayError

    with refusing(DisplayError, kind=pytest.skip.Exception):
        this.displays.environment()
    return this.displays


def on_this_machine(config: pytest.Config, case: Case) -> Case:
    """A case for a worker of this machine, whatever `--sim-cluster` says; skips the test where its
    simulator is not here."""
    if not cluster.asked(config):
        return case
    from pytest_simbench.client.environments import missing
    from pytest_simbench.simulator.registry import adapter

    if reason := missing(adapter(case.simulator).info):
        pytest.skip(f"only `repeat` goes to the cluster, this runs here, and {reason}")
    return replace(case, display=_display(session_of(config).run) if case.mode == "gui" else None)


MARK = "repeats"


def expected(session: pytest.Session) -> list[Experiment]:
    """What tests will ask for, in their order; empty where nothing may begin before its test.

    Tests of one repetition tell it by `@pytest.mark.repeats("PARAMETER")`.
    """
    config = session.config
    alone = not hasattr(config, "workerinput") and not cluster.asked(config)
    again = options.given(config, "sim_resume")
    if not alone or again or options.value(config, "sim_jobs") < 2:
        return []
    return [experiment for item in session.items for experiment in _of(item)]


def _of(item: pytest.Item) -> Iterator[Experiment]:
    """The experiment of a test of one repetition, if it tells and runs without a window."""
    from pytest_simbench.experiment.experiment import Experiment
    from pytest_simbench.experiment.variants import Variant
    from pytest_simbench.plugin.marks import number
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
    settings = item._fixtureinfo.name2fixturedefs.get("sim_settings")  # type: ignore[attr-defined]
    if settings and settings[-1].func.__module__ != "pytest_simbench.plugin.fixtures":
        return  # the test's own, which only it knows
    with suppress(SimulatorError):  # its test tells
        found = Experiment(case_of(item.config, variant, item, {}), task)
        if found.sole or number(item, "sim_reps") == 1:
            yield found
