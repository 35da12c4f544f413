"""Registering the options beside those of other plugins and of the project's own conftest.

Every option begins with `--sim-`; some have a short name besides, `--gui` for instance, which
others want too. pytest raises when two want the same, whoever comes second. So ours come last,
after all plugins and conftests, and take what is free. Imported at plugin load: standard library
only.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from typing import Any

import pytest

from pytest_simbench.plugin.options import OPTIONS, OURS, Option, name_of


def register(parser: pytest.Parser, config: pytest.Config) -> None:
    """Add all options and ini twins whose names nobody has."""
    group = parser.getgroup("simbench", "comparison of robot simulators")
    free = _free(parser, [flag for item in OPTIONS for flag in item.flags])
    ours = set()
    for item in OPTIONS:
        for flag in item.flags if item.flag in free else ():
            if flag in free:
                group.addoption(flag, **_arguments(item, flag))
                ours.add(flag)
        for name in map(name_of, item.flags if item.ini else ()):
            if _is_free_ini(config, name):
                text = item.help if name == item.name else f"the same as {item.name}"
                parser.addini(name, text, type=item.kind.ini, default=None)
                ours.add(name)
    config.stash[OURS] = frozenset(ours)


def is_conftest(plugin: object) -> bool:
    """Whether a plugin is a conftest.py."""
    return os.path.basename(getattr(plugin, "__file__", None) or "") == "conftest.py"


def foreign(config: pytest.Config) -> list[str]:
    """What of our names on the command line belongs to others here, and how to write it; one
    sentence each."""
    ours = config.stash.get(OURS, frozenset())
    return [
        f"{flag} belongs to another plugin or to a conftest here"
        + (f": write {item.flag} for this one's" if item.flag in ours else "; ours has no other")
        for item in OPTIONS
        for flag in item.flags
        if flag not in ours
    ]


def without_ours(args: Sequence[str]) -> list[str]:
    """A command line without our options and their values.

    pytest looks for conftests in the files and folders of a command line before it knows our
    options, and would take their values for such.
    """
    rest: list[str] = []
    before, takes = "", None  # the option before, and how many values it takes, as argparse has it
    for arg in args:
        flag, equals, _ = arg.partition("=")
        if flag in _TAKES:
            before, takes = flag, None if equals else _TAKES[flag]
        elif not takes or arg.startswith("-"):
            takes = None
            rest.append(arg)
        else:
            takes = takes - 1 if isinstance(takes, int) else takes if takes == "+" else None
            # A short name may turn out to be a conftest's own flag, which takes no value.
            if before in _SHORT and os.path.exists(arg):
                rest.append(arg)
    return rest


_TAKES = {
    flag: None if item.kind.flag else item.arguments.get("nargs", 1)
    for item in OPTIONS
    for flag in item.flags
}
_SHORT = {item.short for item in OPTIONS}


def _arguments(item: Option, flag: str) -> dict[str, Any]:
    """What argparse is told of an option."""
    text = item.help if flag == item.flag else f"the same as {item.flag}"
    # argparse formats help texts with %, in which ours mean nothing
    arguments: dict[str, Any] = {
        "dest": item.name,
        "default": None,
        "help": text.replace("%", "%%"),
    }
    if item.kind.flag:
        return {**arguments, "action": "store_true"}
    action = "append" if item.kind.many else "store"
    return {**arguments, "metavar": item.metavar, "action": action, **item.arguments}


def _free(parser: pytest.Parser, flags: Sequence[str]) -> set[str]:
    """Those that nobody registered. pytest tells it by what it does not understand."""

    def unknown(flags: Iterable[str]) -> set[str]:
        try:
            rest = parser.parse_known_and_unknown_args([f"{flag}=?" for flag in flags])[1]
        except Exception:  # somebody's option understood it, and found ? wrong
            return set()
        return {text.removesuffix("=?") for text in rest}

    found = unknown(flags)
    return found if found else {flag for flag in flags if unknown([flag])}


def _is_free_ini(config: pytest.Config, name: str) -> bool:
    try:
        config.getini(name)
    except ValueError as error:
        return "unknown configuration value" in str(error)
    except Exception:  # somebody's, and wrongly set
        return False
    return False
