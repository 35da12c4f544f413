"""What the marks of a test say: on which simulators it runs, what it needs of them, how often."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import pytest

from pytest_simbench.cli.selection import Selection
from pytest_simbench.cli.values import REPETITIONS, SECONDS, SHARE, BadValue, shown
from pytest_simbench.experiment.variants import Variant
from pytest_simbench.ground.text import in_one_line
from pytest_simbench.ground.versions import covers
from pytest_simbench.plugin import options
from pytest_simbench.simulator import registry
from pytest_simbench.simulator.info import Capability

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
            id_ = variant.id_with(len(selection.profiles))
            result.append(pytest.param(variant, id=id_, marks=marks))
    return result or [NOTHING]


def _wanted(node: Any, name: str) -> bool:
    chosen = [name for mark in node.iter_markers("only_sim") for name in _names(mark, node)]
    return not chosen or _among(chosen, name)


def _among(asked: Sequence[str], name: str) -> bool:
    """Whether a simulator is one of those that a mark names: a bare name means every version."""
    return any(covers(other, name) for other in asked)


def _marks(node: Any, variant: Variant, selection: Selection) -> list[pytest.MarkDecorator]:
    name, mode = variant.simulator, variant.mode
    marks = []
    reason = selection.missing(name, variant.profile)
    if reason:
        marks.append(pytest.mark.skip(reason=reason))
    if registry.problem(name):
        return marks  # nothing else is known of it
    info = registry.adapter(name).info
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
            if capability not in registry.adapter(name).info.capabilities:
                marks.append(pytest.mark.skip(reason=f"{name} has no {capability}"))
    return marks


def skip_what_parameters_need(items: Iterable[pytest.Item]) -> None:
    """Apply `needs` marks of a test's other parameters, as of one law of many: `parameters` cannot
    see them yet."""
    for item in items:
        chosen = getattr(item, "callspec", None)
        variant = chosen.params.get("sim_case") if chosen is not None else None
        if not isinstance(variant, Variant) or variant in NOTHING.values:
            continue
        if any(item.iter_markers("needs")) and not registry.problem(variant.simulator):
            for mark in _needs(item, variant.simulator):
                item.add_marker(mark)


def _names(mark: pytest.Mark, node: Any) -> list[str]:
    _check_keywords(mark, node)
    if not mark.args:
        raise pytest.UsageError(f"{node.nodeid}: {mark.name} needs the name of a simulator")
    with options.refusing(registry.UnknownSimulatorError, f"{node.nodeid}: {mark.name}"):
        registry.check_names(map(str, mark.args))
    return list(mark.args)


def named(item: pytest.Item, own: str) -> tuple[str, str]:
    """The id of a test without its parameters; and what the id has of other parameters than ours.

    Args:
        own: our part of the id, from `Variant.id_with`.
    """
    chosen = getattr(item, "callspec", None)
    if chosen is None:
        return item.nodeid, ""
    others = [part for part in chosen._idlist if part != own]
    return item.nodeid.removesuffix(f"[{chosen.id}]"), "-".join(others)


def describe_failure(item: pytest.Item, report: pytest.TestReport, profiles: int) -> dict[str, Any]:
    """Plain data of a claim: that a test of a simulator failed as a whole, and why."""
    variant = item.callspec.params["sim_case"]  # type: ignore[attr-defined]
    function, others = named(item, variant.id_with(profiles))
    crash = getattr(report.longrepr, "reprcrash", None)
    message = crash.message if crash else str(report.longrepr)
    return {
        "test": item.nodeid,
        "function": function,
        "variant": others,
        "simulator": variant.simulator,
        "mode": variant.mode,
        "profile": variant.profile,
        "verdict": "FAIL",
        "advice": in_one_line(message.split("\n")[0]),
    }


NUMBERS = {"reps": REPETITIONS, "sim_timeout": SECONDS, "sim_crashes": SHARE}
"""What the marks that take a number may hold."""

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


def number(item: pytest.Item, name: str) -> Any:
    """What an option says of a test: as it is typed, else as the test's mark of the same name has
    it, else as the ini file has it."""
    typed = options.given(item.config, name)
    found = None if typed else number_mark(item, options.name_of(options.option(name).flag))
    return options.value(item.config, name) if found is None else found


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
        return NUMBERS[name].check(*(mark.args or [None]))
    except BadValue as error:
        raise pytest.UsageError(
            f"{node.nodeid}: {name}({shown(repr(error.text))}): {error.advice}"
        ) from None
