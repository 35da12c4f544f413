"""Which simulators, modes and robots a run covers, from options; all checks of user input."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import pytest

from pytest_simbench.client import environments
from pytest_simbench.cluster.offers import Node, unmet
from pytest_simbench.ground.versions import base_name
from pytest_simbench.plugin import cluster, options
from pytest_simbench.plugin.history import releases_of
from pytest_simbench.plugin.interpreters import checked_specification, interpreter_path
from pytest_simbench.plugin.simulator_names import install_missing, progress, read_names
from pytest_simbench.plugin.values import shown
from pytest_simbench.plugin.variants import Variant, problem, variants
from pytest_simbench.scene import Robot
from pytest_simbench.simulator import registry
from pytest_simbench.simulator.errors import SettingsError, SimulatorError
from pytest_simbench.simulator.settings import Settings

MODES = ("headless", "gui")


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
            unknown = registry.problem(name) or self._settings_problem(name, (profile,))
            if self.sweep is None or unknown:
                found.append(Variant(name, mode, profile))
            else:
                own = self._settings(name, profile).timestep
                found += variants(name, mode, profile, own, self.sweep)
        return found

    def changes_of(self, name: str) -> dict[str, str]:
        """Changed settings of a simulator."""
        return {**self.changes.get(base_name(name), {}), **self.changes.get(name, {})}

    def missing(self, name: str, profiles: Sequence[str] = ()) -> str | None:
        """Why a simulator cannot run here, or on the cluster, with what mends it; None when it
        can.

        Args:
            name: of the simulator.
            profiles: that it needs; none for all of the run.
        """
        found = registry.problem(name) or self._settings_problem(name, profiles)
        if found:
            return found
        if self.nodes:
            modes = [mode for mode in self.modes if mode in registry.adapter(name).info.modes]
            return unmet(self.nodes, name, modes)
        if name in self.pythons or name in self.specs:
            return None
        return environments.missing(registry.adapter(name).info)

    def unusable(self, name: str) -> str | None:
        """Why a simulator cannot run in any of the profiles. Tests in those that one lacks are
        skipped, with the reason."""
        reasons = [self.missing(name, (profile,)) for profile in self.profiles]
        return reasons[0] if all(reasons) else None

    def _settings(self, name: str, profile: str) -> Settings:
        """Of a simulator, in a profile, as the user changed them.

        Raises:
            SettingsError: it has no such profile, or cannot take a change.
        """
        return registry.settings_of(name, profile, self.changes_of(name))

    def _settings_problem(self, name: str, profiles: Sequence[str] = ()) -> str | None:
        try:
            for profile in profiles or self.profiles:
                self._settings(name, profile)
        except SettingsError as error:
            return str(error)
        return None


def select(config: pytest.Config) -> Selection:
    """The checked selection.

    Raises:
        pytest.UsageError: an unknown or broken simulator, an unknown setting or profile, an
            interpreter or specification that cannot be one; one sentence.
    """
    with options.refusing(SimulatorError):
        selection = _select(config)
    return selection


def _select(config: pytest.Config) -> Selection:
    for name in options.value(config, "sim_profile"):
        _check_profile(name)
    sweep = options.value(config, "sim_sweep")
    if not isinstance(sweep, bool | None) and (wrong := problem(sweep)):
        raise pytest.UsageError(wrong)
    asked = options.value(config, "sim_name")
    names, builds = read_names([name for name in asked if name != "all"], config)
    names += releases_of(config)
    changes: dict[str, dict[str, str]] = {}
    for key, text in options.value(config, "sim_set").items():
        name, _, setting = key.rpartition(".")
        if not (name and setting):
            raise pytest.UsageError(f"--sim-set={key}={text}: write it as SIM.SETTING=VALUE")
        changes.setdefault(name, {})[setting] = text
    pythons = {
        name: interpreter_path(path, f"--sim-python={name}={shown(path)}", config)
        for name, path in options.value(config, "sim_python").items()
    }
    specs = {
        name: checked_specification(text, f"--sim-spec={name}={shown(text)}")
        for name, text in options.value(config, "sim_spec").items()
    }
    named = [*names, *changes, *pythons, *specs]
    registry.check_names(named)
    for name in named:
        registry.adapter(name)  # complains of a broken one
    for name in pythons.keys() & specs.keys():
        raise pytest.UsageError(
            f"{name} has both --sim-python and --sim-spec; a specification names its own "
            "interpreter (python=...), so give one of them"
        )
    if _installs(config):
        install_missing(names, progress())
    everything = registry.known() if not names or "all" in asked else []
    selection = Selection(
        tuple(dict.fromkeys([*everything, *names])),
        _modes(config),
        options.value(config, "sim_profile"),
        changes,
        {**builds, **pythons},
        specs,
        _robots(options.value(config, "sim_robot")),
        cluster.nodes(config),
        sweep,
    )
    for name in changes:
        if refused := selection._settings_problem(name):
            raise pytest.UsageError(refused)
    for name in names:
        if reason := selection.unusable(name):
            raise pytest.UsageError(reason)
    if asked or names:
        return selection
    here = tuple(name for name in selection.simulators if not selection.unusable(name))
    return replace(selection, simulators=here)


def _installs(config: pytest.Config) -> bool:
    """Whether missing environments are made before the run; xdist's workers find them made, and a
    cluster's nodes have their own."""
    asked = ("sim_install_missing", "sim_history")
    here = not (hasattr(config, "workerinput") or cluster.asked(config))
    return here and any(options.value(config, name) for name in asked)


EVERY = "all"
"""Every built-in robot, as the value of `--robot`."""


def _robots(text: str | None) -> Mapping[str, Robot | None]:
    """The robots of that name or file; "" for the one that the tasks have anyway."""
    if text is None:
        return {"": None}
    from pytest_simbench.robot.errors import RobotError
    from pytest_simbench.robot.registry import BUILT_IN, DEFAULT, find

    names = BUILT_IN if text == EVERY else [text]
    with options.refusing(RobotError, f"--robot={shown(text)}"):
        found = [None if name == DEFAULT else find(name) for name in names]
    return {"" if robot is None else robot.name: robot for robot in found}


def _check_profile(name: str) -> None:
    valid = dict.fromkeys(
        found for sim in registry.registered() for found in registry.adapter(sim).profiles
    )
    if name not in valid:
        raise pytest.UsageError(
            f"no simulator has a settings profile {name!r}; choose from {', '.join(valid)}"
        )


def _modes(config: pytest.Config) -> tuple[str, ...]:
    gui, headless = options.value(config, "sim_gui"), options.value(config, "sim_headless")
    if gui:
        return MODES if headless else ("gui",)
    return ("headless",)
