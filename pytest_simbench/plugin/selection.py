"""What the options ask for: which simulators, modes and robots a run covers, installed where that
is asked for."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pytest_simbench.cli.interpreters import checked_specification, interpreter_path
from pytest_simbench.cli.names import install_missing, progress, read_names
from pytest_simbench.cli.selection import EVERY, MODES, Selection, check, profiles_of, robots_of
from pytest_simbench.cli.values import BadInput, shown
from pytest_simbench.ground.errors import SimulatorError
from pytest_simbench.plugin import cluster, options
from pytest_simbench.plugin.history import releases_of
from pytest_simbench.simulator import registry


def select(config: pytest.Config) -> Selection:
    """What the options ask for, checked and installed.

    Raises:
        pytest.UsageError: an unknown or broken simulator, an unknown setting or profile, an
            interpreter or specification that cannot be one; one sentence.
    """
    with options.refusing((SimulatorError, BadInput)):
        selection = parse(config)
        makes = _installs(config)
        check(selection, makes)
        if makes:
            install(selection)
    return selection if options.value(config, "sim_name") else selection.ready()


def parse(config: pytest.Config) -> Selection:
    """What the options say. Nothing is held against settings or environments yet.

    Raises:
        BadInput: a name, interpreter or specification that cannot be one.
        RobotError, SimulatorError, pytest.UsageError: a robot, history or cluster that cannot be.
    """
    here, asked = config.invocation_params.dir, options.value(config, "sim_name")
    with options.refusing(BadInput, "--sim"):
        names, builds = read_names([name for name in asked if name != EVERY], here)
    names += releases_of(config)
    changes: dict[str, dict[str, str]] = {}
    for key, text in options.value(config, "sim_set").items():
        name, _, setting = key.rpartition(".")
        if not (name and setting):
            raise BadInput(f"--sim-set={key}={text}: write it as SIM.SETTING=VALUE")
        changes.setdefault(name, {})[setting] = text
    pythons = {
        name: interpreter_path(path, f"--sim-python={name}={shown(path)}", here)
        for name, path in options.value(config, "sim_python").items()
    }
    specs = {
        name: checked_specification(text, f"--sim-spec={name}={shown(text)}")
        for name, text in options.value(config, "sim_spec").items()
    }
    everything = registry.known() if not names or EVERY in asked else []
    profiles, read = profiles_of(options.value(config, "sim_profile"))
    files = {k: replace(f, path=options.from_root(config, f.path)) for k, f in read.items()}
    gui, headless = options.value(config, "sim_gui"), options.value(config, "sim_headless")
    return Selection(
        tuple(dict.fromkeys([*everything, *names])),
        (MODES if headless else ("gui",)) if gui else ("headless",),
        profiles,
        changes,
        {**builds, **pythons},
        specs,
        robots_of(options.value(config, "sim_robot")),
        cluster.nodes(config),
        options.value(config, "sim_sweep"),
        tuple(names),
        files,
    )


def install(selection: Selection) -> None:
    """Make the environments that are missing.

    Raises:
        SimulatorError: one cannot be made.
        BadInput: a simulator is missing that has no environment of its own.
    """
    install_missing(selection.named, progress())
    check(selection, makes=False)


def _installs(config: pytest.Config) -> bool:
    """Whether missing environments are made before the run; xdist's workers find them made, and a
    cluster's nodes have their own."""
    asked = ("sim_install_missing", "sim_history")
    here = not (hasattr(config, "workerinput") or cluster.asked(config))
    return here and any(options.value(config, name) for name in asked)
