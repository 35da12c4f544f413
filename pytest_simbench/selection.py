"""Which simulators and modes a run covers, from options and marks; all checks of user input."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf
from typing import TYPE_CHECKING, Any

import pytest

from pytest_simbench import options

if TYPE_CHECKING:
    from pytest_simbench.client.environments import Environment

MODES = ("headless", "gui")


@dataclass(frozen=True)
class Selection:
    """What the user asked for, checked.

    Attributes:
        simulators: names, in order.
        explicit: the names that were asked for one by one; a missing one is an error.
        modes: `headless`, `gui`.
        profile: settings profile.
        changes: simulator name to changed settings, as texts.
        pythons, specs: simulator name to interpreter or execnet specification.
    """

    simulators: tuple[str, ...]
    explicit: frozenset[str]
    modes: tuple[str, ...]
    profile: str
    changes: dict[str, dict[str, str]] = field(default_factory=dict)
    pythons: dict[str, str] = field(default_factory=dict)
    specs: dict[str, str] = field(default_factory=dict)

    def missing(self, name: str) -> str | None:
        """Why a simulator cannot run here, with what mends it; None when it can."""
        from pytest_simbench.client.environments import missing
        from pytest_simbench.simulator.registry import adapter

        if name in self.pythons or name in self.specs:
            return None
        return missing(adapter(name).info)

    def environment(self, name: str) -> Environment:
        """The place of a simulator's own environment."""
        from pytest_simbench.client.environments import Environment
        from pytest_simbench.simulator.registry import adapter

        return Environment.of(adapter(name).info)

    def python(self, name: str) -> str | None:
        """Interpreter of a simulator's workers; None for this one."""
        from pytest_simbench.client.environments import interpreter
        from pytest_simbench.simulator.registry import adapter

        return self.pythons.get(name) or interpreter(adapter(name).info)


def select(config: pytest.Config) -> Selection:
    """The checked selection.

    Raises:
        pytest.UsageError: unknown simulator, setting, profile, or a malformed value.
    """
    from pytest_simbench.simulator.errors import SimulatorError

    try:
        return _select(config)
    except SimulatorError as error:
        raise pytest.UsageError(str(error)) from None


def _select(config: pytest.Config) -> Selection:
    from pytest_simbench.simulator.registry import adapter, check_names, registered
    from pytest_simbench.simulator.settings import changed, profile

    asked = options.value(config, "sim")
    names = [name for name in asked if name != "all"]
    check_names(names)
    pythons = options.assignments(config, "sim_python")
    specs = options.assignments(config, "sim_spec")
    check_names([*pythons, *specs])
    profile_name = options.value(config, "sim_profile")
    changes: dict[str, dict[str, str]] = {}
    for key, text in options.assignments(config, "sim_set").items():
        name, dot, setting = key.partition(".")
        if not dot:
            raise pytest.UsageError(f"--sim-set {key}={text}: write it as SIM.SETTING=VALUE")
        check_names([name])
        changes.setdefault(name, {})[setting] = text
    everything = tuple(registered()) if not names or "all" in asked else tuple(dict.fromkeys(names))
    for name in {*everything, *changes}:
        changed(profile(adapter(name).profiles, profile_name, name), changes.get(name, {}), name)
    selection = Selection(
        everything, frozenset(names), _modes(config), profile_name, changes, pythons, specs
    )
    for name in names:
        reason = selection.missing(name)
        if reason:
            raise pytest.UsageError(reason)
    if not asked:
        here = tuple(name for name in everything if not selection.missing(name))
        selection = Selection(
            here, frozenset(), selection.modes, profile_name, changes, pythons, specs
        )
    return selection


def _modes(config: pytest.Config) -> tuple[str, ...]:
    gui, headless = options.value(config, "gui"), options.value(config, "headless")
    if gui:
        return MODES if headless else ("gui",)
    return ("headless",)


def check_numbers(config: pytest.Config) -> None:
    """Check the plain numbers.

    Raises:
        pytest.UsageError: zero repetitions, a negative time-out and the like.
    """
    options.repetitions(config)
    for name, least in (
        ("sim_jobs", 1), ("jitter", 0), ("sim_seed", 0), ("sim_timeout", 1e-3),
        ("sim_stall_timeout", 1e-3), ("sim_memory_limit", 1),
    ):  # fmt: skip
        number = options.value(config, name)
        if number is not None and not number >= least:
            flag = "--" + name.replace("_", "-")
            raise pytest.UsageError(f"{flag} {number}: give at least {least:g}")
    for name in ("protocol", "sim_trace"):
        options.value(config, name)
    for metric, text in options.assignments(config, "sim_threshold").items():
        try:
            float(text)
        except ValueError:
            raise pytest.UsageError(
                f"--sim-threshold {metric}={text}: the value must be a number"
            ) from None


def parameters(metafunc: pytest.Metafunc, selection: Selection) -> list[Any]:
    """Parameters `(simulator, mode)` of a test, with what its marks say of each.

    Raises:
        pytest.UsageError: a mark with an unknown simulator or capability.
    """
    node = metafunc.definition
    names = [name for name in selection.simulators if _wanted(node, name)]
    result = []
    for name in names:
        for mode in selection.modes:
            marks = _marks(node, name, mode, selection)
            result.append(pytest.param((name, mode), id=f"{name}-{mode}", marks=marks))
    if not result:
        skip = pytest.mark.skip(reason="no selected simulator fits the only_sim mark")
        result.append(pytest.param(("none", "headless"), id="none", marks=[skip]))
    return result


def _wanted(node: Any, name: str) -> bool:
    chosen: list[str] = []
    for mark in node.iter_markers("only_sim"):
        chosen += _names(mark, node)
    return not chosen or name in chosen


def _marks(node: Any, name: str, mode: str, selection: Selection) -> list[pytest.MarkDecorator]:
    from pytest_simbench.simulator.info import Capability
    from pytest_simbench.simulator.registry import adapter

    marks = []
    reason = selection.missing(name)
    if reason:
        marks.append(pytest.mark.skip(reason=reason))
    info = adapter(name).info
    if mode not in info.modes:
        marks.append(pytest.mark.skip(reason=f"{name} has no window"))
    for mark in node.iter_markers("skip_sim"):
        if name in _names(mark, node):
            marks.append(pytest.mark.skip(reason=mark.kwargs.get("reason", f"skip_sim({name})")))
    for mark in node.iter_markers("xfail_sim"):
        if name in _names(mark, node):
            marks.append(pytest.mark.xfail(reason=mark.kwargs.get("reason", "")))
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
            if capability not in info.capabilities:
                marks.append(pytest.mark.skip(reason=f"{name} has no {capability}"))
    return marks


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
    """The positive number in a mark such as `reps(5)`, or None without the mark.

    Raises:
        pytest.UsageError: no argument, or not a positive number.
    """
    mark = node.get_closest_marker(name)
    if mark is None:
        return None
    _check_keywords(mark, node)
    if len(mark.args) > 1:
        raise pytest.UsageError(f"{node.nodeid}: {name}{mark.args!r}: give one number")
    number = mark.args[0] if mark.args else None
    whole = name == "reps"
    if (
        isinstance(number, bool)
        or not isinstance(number, int if whole else int | float)
        or not 0 < number < inf
    ):
        noun = "positive whole number" if whole else "positive number"
        raise pytest.UsageError(f"{node.nodeid}: {name}({number!r}): give a {noun}")
    return number
