"""Which simulators and modes a run covers, from options and marks; all checks of user input."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import pytest

from pytest_simbench.plugin import cluster, options
from pytest_simbench.plugin.history import releases_of
from pytest_simbench.plugin.interpreters import checked_specification, interpreter_path
from pytest_simbench.plugin.simulator_names import install_missing, progress, read_names
from pytest_simbench.plugin.values import BadValue, shown
from pytest_simbench.plugin.variants import Variant, problem, variants

if TYPE_CHECKING:
    from pytest_simbench.cluster.offers import Node
    from pytest_simbench.scene import Robot
    from pytest_simbench.simulator.info import SimulatorInfo
    from pytest_simbench.simulator.settings import Settings

MODES = ("headless", "gui")


@dataclass(frozen=True)
class Selection:
    """What the user asked for, checked.

    Attributes:
        simulators: names, in order.
        explicit: the names that were asked for one by one; a missing one is an error.
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
    explicit: frozenset[str]
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

    def id_of(self, variant: Variant) -> str:
        """Of the parameter of a test; the default robot adds nothing."""
        return variant.id_with(len(self.profiles))

    def variants(self, name: str, mode: str) -> list[Variant]:
        """What a test is made for, of one simulator and mode."""
        found = self._of_one_robot(name, mode)
        return [variant._replace(robot=robot) for robot in self.robots for variant in found]

    def _of_one_robot(self, name: str, mode: str) -> list[Variant]:
        from pytest_simbench.simulator.registry import problem

        found = []
        for profile in self.profiles:
            unknown = problem(name) or self._settings_problem(name, (profile,))
            if self.sweep is None or unknown:
                found.append(Variant(name, mode, profile))
            else:
                own = self._settings(name, profile).timestep
                found += variants(name, mode, profile, own, self.sweep)
        return found

    def changes_of(self, name: str) -> dict[str, str]:
        """Changed settings of a simulator."""
        from pytest_simbench.simulator.versions import base_name

        return {**self.changes.get(base_name(name), {}), **self.changes.get(name, {})}

    def missing(self, name: str, profiles: Sequence[str] = ()) -> str | None:
        """Why a simulator cannot run here, or on the cluster, with what mends it; None when it
        can.

        Args:
            name: of the simulator.
            profiles: that it needs; none for all of the run.
        """
        from pytest_simbench.client.environments import missing
        from pytest_simbench.simulator.registry import problem

        found = problem(name) or self._settings_problem(name, profiles)
        if found:
            return found
        if self.nodes:
            from pytest_simbench.cluster.offers import unmet

            modes = [mode for mode in self.modes if mode in _info(name).modes]
            return unmet(self.nodes, name, modes)
        if name in self.pythons or name in self.specs:
            return None
        return missing(_info(name))

    def _settings(self, name: str, profile: str) -> Settings:
        """Of a simulator, in a profile, as the user changed them.

        Raises:
            SettingsError: it has no such profile, or cannot take a change.
        """
        from pytest_simbench.simulator.registry import adapter
        from pytest_simbench.simulator.settings import changed
        from pytest_simbench.simulator.settings import profile as named

        found = named(adapter(name).profiles, profile, name)
        return changed(found, self.changes_of(name), name)

    def _settings_problem(self, name: str, profiles: Sequence[str] = ()) -> str | None:
        from pytest_simbench.simulator.errors import SettingsError

        try:
            for profile in profiles or self.profiles:
                self._settings(name, profile)
        except SettingsError as error:
            return str(error)
        return None


def _info(name: str) -> SimulatorInfo:
    from pytest_simbench.simulator.registry import adapter

    return adapter(name).info


def select(config: pytest.Config) -> Selection:
    """The checked selection.

    Raises:
        pytest.UsageError: an unknown or broken simulator, an unknown setting or profile, an
            interpreter or specification that cannot be one; one sentence.
    """
    from pytest_simbench.simulator.errors import SimulatorError

    try:
        return _select(config)
    except SimulatorError as error:
        raise pytest.UsageError(str(error)) from None


def _select(config: pytest.Config) -> Selection:
    from pytest_simbench.simulator.registry import adapter, check_names, known

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
    check_names(named)
    for name in named:
        adapter(name)  # complains of a broken one
    for name in pythons.keys() & specs.keys():
        raise pytest.UsageError(
            f"{name} has both --sim-python and --sim-spec; a specification names its own "
            "interpreter (python=...), so give one of them"
        )
    if _installs(config):
        install_missing(names, progress())
    everything = known() if not names or "all" in asked else []
    selection = Selection(
        tuple(dict.fromkeys([*everything, *names])),
        frozenset(names),
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
        reason = selection.missing(name)
        if reason:
            raise pytest.UsageError(reason)
    if asked or names:
        return selection
    here = [
        name
        for name in selection.simulators
        if not all(selection.missing(name, (profile,)) for profile in selection.profiles)
    ]
    return replace(selection, simulators=tuple(here))


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
    try:
        found = [None if name == DEFAULT else find(name) for name in names]
        return {"" if robot is None else robot.name: robot for robot in found}
    except RobotError as error:
        raise pytest.UsageError(f"--robot={shown(text)}: {error}") from None


def _check_profile(name: str) -> None:
    from pytest_simbench.simulator.registry import adapter, registered

    valid = dict.fromkeys(found for sim in registered() for found in adapter(sim).profiles)
    if name not in valid:
        raise pytest.UsageError(
            f"no simulator has a settings profile {name!r}; choose from {', '.join(valid)}"
        )


def _modes(config: pytest.Config) -> tuple[str, ...]:
    gui, headless = options.value(config, "sim_gui"), options.value(config, "sim_headless")
    if gui:
        return MODES if headless else ("gui",)
    return ("headless",)


NOTHING = pytest.param(
    Variant("none", "headless", ""),
    id="none",
    marks=[pytest.mark.skip(reason="no selected simulator fits the only_sim mark")],
)
"""The parameter of a test that runs on no simulator."""


def parameters(metafunc: pytest.Metafunc, selection: Selection) -> list[Any]:
    """Variants to make a test for, with what its marks say of each.

    Raises:
        pytest.UsageError: a mark with an unknown simulator or capability.
    """
    node = metafunc.definition
    names = [name for name in selection.simulators if _wanted(node, name)]
    result = []
    for name in names:
        for variant in (v for mode in selection.modes for v in selection.variants(name, mode)):
            marks = _marks(node, variant, selection)
            result.append(pytest.param(variant, id=selection.id_of(variant), marks=marks))
    return result or [NOTHING]


def _wanted(node: Any, name: str) -> bool:
    chosen: list[str] = []
    for mark in node.iter_markers("only_sim"):
        chosen += _names(mark, node)
    return not chosen or _among(chosen, name)


def _among(asked: Sequence[str], name: str) -> bool:
    """Whether a simulator is one of those that a mark names: a bare name means every version."""
    from pytest_simbench.simulator.versions import covers

    return any(covers(other, name) for other in asked)


def _marks(node: Any, variant: Variant, selection: Selection) -> list[pytest.MarkDecorator]:
    from pytest_simbench.simulator.registry import problem

    name, mode = variant.simulator, variant.mode
    marks = []
    reason = selection.missing(name, (variant.profile,))
    if reason:
        marks.append(pytest.mark.skip(reason=reason))
    if problem(name):
        return marks  # nothing else is known of it
    info = _info(name)
    if mode not in info.modes:
        marks.append(pytest.mark.skip(reason=f"{name} has no window"))
    for mark in node.iter_markers("skip_sim"):
        if _among(_names(mark, node), name):
            marks.append(pytest.mark.skip(reason=mark.kwargs.get("reason", f"skip_sim({name})")))
    for mark in node.iter_markers("xfail_sim"):
        if _among(_names(mark, node), name):
            marks.append(pytest.mark.xfail(reason=mark.kwargs.get("reason", "")))
    return [*marks, *_needs(node, name)]


def _needs(node: Any, name: str) -> list[pytest.MarkDecorator]:
    """Skips for what a node's `needs` marks ask for and a simulator has not."""
    from pytest_simbench.simulator.info import Capability

    marks = []
    for mark in node.iter_markers("needs"):
        _check_keywords(mark, node)
        if not mark.args:
            raise pytest.UsageError(
                f"{node.nodeid}: needs() without a capability: choose from {', '.join(Capability)}"
            )
        for capability in mark.args:
            if capability not in list(Capability):
                raise pytest.UsageError(
                    f"{node.nodeid}: needs({capability!r}): choose from {', '.join(Capability)}"
                )
            if capability not in _info(name).capabilities:
                marks.append(pytest.mark.skip(reason=f"{name} has no {capability}"))
    return marks


def skip_what_parameters_need(items: Iterable[pytest.Item]) -> None:
    """Apply `needs` marks of a test's other parameters, as of one law of many: `parameters` cannot
    see them yet."""
    from pytest_simbench.simulator.registry import problem

    for item in items:
        chosen = getattr(item, "callspec", None)
        variant = chosen.params.get("sim_case") if chosen is not None else None
        if not isinstance(variant, Variant) or variant in NOTHING.values:
            continue
        if any(item.iter_markers("needs")) and not problem(variant.simulator):
            for mark in _needs(item, variant.simulator):
                item.add_marker(mark)


def _names(mark: pytest.Mark, node: Any) -> list[str]:
    from pytest_simbench.simulator.registry import UnknownSimulatorError, check_names

    _check_keywords(mark, node)
    if not mark.args:
        raise pytest.UsageError(f"{node.nodeid}: {mark.name} needs the name of a simulator")
    try:
        check_names(map(str, mark.args))
    except UnknownSimulatorError as error:
        raise pytest.UsageError(f"{node.nodeid}: {mark.name}: {error}") from None
    return list(mark.args)


KEYWORDS = {"skip_sim": ("reason",), "xfail_sim": ("reason",)}
"""Keyword arguments of the marks that take any."""


def _check_keywords(mark: pytest.Mark, node: Any) -> None:
    valid = KEYWORDS.get(mark.name, ())
    for key, value in mark.kwargs.items():
        if key not in valid:
            allowed = f"it takes {', '.join(valid)}" if valid else "it takes none"
            raise pytest.UsageError(
                f"{node.nodeid}: {mark.name} has no keyword argument {key!r}; {allowed}"
            )
        if not isinstance(value, str):
            raise pytest.UsageError(f"{node.nodeid}: {mark.name}: {key} must be a text")


def number_mark(node: Any, name: str) -> Any:
    """The number in a mark such as `reps(5)`, or None without the mark.

    Raises:
        pytest.UsageError: no argument, or no number that the option could have.
    """
    mark = node.get_closest_marker(name)
    if mark is None:
        return None
    _check_keywords(mark, node)
    if len(mark.args) > 1:
        raise pytest.UsageError(f"{node.nodeid}: {name}{shown(mark.args)}: give one number")
    try:
        return options.number(f"sim_{name.removeprefix('sim_')}", *(mark.args or [None]))
    except BadValue as error:
        raise pytest.UsageError(
            f"{node.nodeid}: {name}({shown(repr(error.text))}): {error.advice}"
        ) from None
