"""Which simulators, modes and robots a run covers: parsed from the options, then checked, then
installed where that is asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import pytest

from pytest_simbench.cli.interpreters import checked_specification, interpreter_path
from pytest_simbench.cli.names import install_missing, progress, read_names
from pytest_simbench.cli.values import BadInput, shown
from pytest_simbench.client import environments
from pytest_simbench.cluster.offers import Node, unmet
from pytest_simbench.ground.errors import SettingsError, SimulatorError
from pytest_simbench.ground.versions import base_name
from pytest_simbench.plugin import cluster, options
from pytest_simbench.plugin.history import releases_of
from pytest_simbench.plugin.variants import Variant, problem, variants
from pytest_simbench.scene import Robot
from pytest_simbench.simulator import registry
from pytest_simbench.simulator.settings import Settings

MODES = ("headless", "gui")

EVERY = "all"
"""Every registered simulator, or every built-in robot."""


@dataclass(frozen=True)
class Selection:
    """What the user asked for, checked.

    Attributes:
        simulators: names, in order.
        modes: `headless`, `gui`.
        profiles: settings profiles.
        changes: simulator name to changed settings, as texts; those of a bare name hold for all
            of its versions.
        pythons, specs: simulator name to interpreter or execnet specification.
        robots: that do the tasks, by name; "" for the tasks' own, the Panda.
        nodes: of the cluster that carries repetitions out; none for this machine.
        sweep: time steps to make each test for [s]; True for those around each profile's own, None
            for these alone.
    """

    simulators: tuple[str, ...]
    modes: tuple[str, ...]
    profiles: tuple[str, ...]
    changes: dict[str, dict[str, str]] = field(default_factory=dict)
    pythons: dict[str, str] = field(default_factory=dict)
    specs: dict[str, str] = field(default_factory=dict)
    robots: Mapping[str, Robot | None] = field(default_factory=lambda: {"": None})
    nodes: tuple[Node, ...] = ()
    sweep: bool | tuple[float, ...] | None = None
    named: tuple[str, ...] = ()

    @property
    def every_robot(self) -> bool:
        """Whether what a robot cannot do is no error: nobody asked for it by name."""
        return len(self.robots) > 1

    def variants(self, name: str, mode: str) -> list[Variant]:
        """What a test is made for, of one simulator and mode."""
        found = self._of_one_robot(name, mode)
        return [variant._replace(robot=robot) for robot in self.robots for variant in found]

    def _of_one_robot(self, name: str, mode: str) -> list[Variant]:
        found = []
        for profile in self.profiles:
            unknown = registry.problem(name) or self.settings_problem(name, profile)
            if self.sweep is None or unknown:
                found.append(Variant(name, mode, profile))
            else:
                own = self._settings(name, profile).timestep
                found += variants(name, mode, profile, own, self.sweep)
        return found

    def changes_of(self, name: str) -> dict[str, str]:
        """Changed settings of a simulator."""
        return {**self.changes.get(base_name(name), {}), **self.changes.get(name, {})}

    def missing(self, name: str, profile: str) -> str | None:
        """Why a simulator cannot run in a profile here, or on the cluster, with what mends it; None
        when it can."""
        found = registry.problem(name) or self.settings_problem(name, profile)
        if found:
            return found
        if self.nodes:
            modes = [mode for mode in self.modes if mode in registry.adapter(name).info.modes]
            return unmet(self.nodes, name, modes)
        if name in self.pythons or name in self.specs:
            return None
        return environments.missing(registry.adapter(name).info)

    def unusable(self, name: str, to_install: bool = False) -> str | None:
        """Why a simulator cannot run in any of the profiles; None when it can. Tests in those that
        one lacks are skipped, with the reason. A missing environment is no fault where it is
        `to_install`."""
        why = self.settings_problem if to_install else self.missing
        reasons = [why(name, profile) for profile in self.profiles]
        return reasons[0] if all(reasons) else None

    def _settings(self, name: str, profile: str) -> Settings:
        """Of a simulator, in a profile, as the user changed them.

        Raises:
            SettingsError: it has no such profile, or cannot take a change.
        """
        return registry.settings_of(name, profile, self.changes_of(name))

    def settings_problem(self, name: str, profile: str) -> str | None:
        """Why a simulator has no such profile, or cannot take a change; None when it can."""
        try:
            self._settings(name, profile)
        except SettingsError as error:
            return str(error)
        return None


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
    if selection.named or options.value(config, "sim_name"):
        return selection
    here = tuple(name for name in selection.simulators if not selection.unusable(name))
    return replace(selection, simulators=here)


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
    gui, headless = options.value(config, "sim_gui"), options.value(config, "sim_headless")
    return Selection(
        tuple(dict.fromkeys([*everything, *names])),
        (MODES if headless else ("gui",)) if gui else ("headless",),
        options.value(config, "sim_profile"),
        changes,
        {**builds, **pythons},
        specs,
        _robots(options.value(config, "sim_robot")),
        cluster.nodes(config),
        options.value(config, "sim_sweep"),
        tuple(names),
    )


def check(selection: Selection, makes: bool) -> None:
    """Complain of what cannot run.

    Args:
        selection: what the options say.
        makes: missing environments are no fault, since they are made afterwards.

    Raises:
        BadInput: one sentence.
        SimulatorError: an unknown or broken simulator.
    """
    valid = dict.fromkeys(
        profile for name in registry.registered() for profile in registry.adapter(name).profiles
    )
    for profile in selection.profiles:
        if profile not in valid:
            raise BadInput(
                f"no simulator has a settings profile {profile!r}; choose from {', '.join(valid)}"
            )
    if isinstance(selection.sweep, tuple) and (wrong := problem(selection.sweep)):
        raise BadInput(wrong)
    named = [*selection.named, *selection.changes, *selection.pythons, *selection.specs]
    registry.check_names(named)
    for name in named:
        registry.adapter(name)  # complains of a broken one
    for name in selection.pythons.keys() & selection.specs.keys():
        raise BadInput(
            f"{name} has both --sim-python and --sim-spec; a specification names its own "
            "interpreter (python=...), so give one of them"
        )
    for name in selection.changes:
        for profile in selection.profiles:
            if refused := selection.settings_problem(name, profile):
                raise BadInput(refused)
    for name in selection.named:
        if reason := selection.unusable(name, to_install=makes):
            raise BadInput(reason)


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


def _robots(text: str | None) -> Mapping[str, Robot | None]:
    """The robots of that name or file; "" for the one that the tasks have anyway."""
    if text is None:
        return {"": None}
    from pytest_simbench.motion.errors import RobotError
    from pytest_simbench.motion.registry import BUILT_IN, DEFAULT, find

    names = BUILT_IN if text == EVERY else [text]
    with options.refusing(RobotError, f"--robot={shown(text)}"):
        found = [None if name == DEFAULT else find(name) for name in names]
    return {"" if robot is None else robot.name: robot for robot in found}
