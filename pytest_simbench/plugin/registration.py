"""Registering the options beside those of other plugins and of the project's own conftest.

Others want some of the short names too, `--gui` for instance, and pytest raises when two want the
same, whoever comes second. So ours come last, after all plugins and conftests, and take what is
free; `--sim-gui` works anyway. Imported at plugin load: standard library only.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterable, Sequence
from typing import Any

import pytest

from pytest_simbench.cli.values import flag
from pytest_simbench.plugin.old_options import OLD_OPTIONS
from pytest_simbench.plugin.options import FLAGS, INI, OPTIONS, Option


def register(parser: pytest.Parser, config: pytest.Config) -> None:
    """Add all options and ini twins whose names nobody has."""
    group = parser.getgroup("simbench", "comparison of robot simulators (all: docs/options.md)")
    names = [name for item in OPTIONS for name in (item.flag, item.long) if name]
    free = _free(parser, [*names, *(command.flag for command in OLD_OPTIONS)])
    flags: dict[str, str] = {}
    ini: set[str] = set()
    for item in OPTIONS:
        for name in (n for n in (item.flag, item.long) if n in free):
            shown = not (item.rare or item.name in flags)
            group.addoption(name, **_arguments(item, shown))
            flags.setdefault(item.name, name)
        for name in item.ini_names:
            if _is_free_ini(config, name):
                parser.addini(name, f"as {item.flag}", type=item.ini or None, default=None)
                ini.add(name)
    for command in OLD_OPTIONS:
        if command.flag in free:
            group.addoption(command.flag, **command.arguments)
    config.stash[FLAGS], config.stash[INI] = flags, frozenset(ini)


def is_conftest(plugin: object) -> bool:
    """Whether a plugin is a conftest.py."""
    return os.path.basename(getattr(plugin, "__file__", None) or "") == "conftest.py"


def without_ours(args: Sequence[str]) -> list[str]:
    """A command line without our options and their values.

    pytest looks for conftests in the files and folders of a command line before it knows our
    options, and would take their values for such.
    """
    ours = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    for item in OPTIONS:
        ours.add_argument(*filter(None, (item.flag, item.long)), **_arguments(item))
    for command in OLD_OPTIONS:
        ours.add_argument(command.flag, **command.arguments)
    try:
        found, rest = ours.parse_known_args([*args])
    except argparse.ArgumentError:  # told later, by pytest's own parser
        return [*args]
    # A short name may turn out to be a conftest's own flag, which takes no value.
    typed = [getattr(found, item.dest) for item in OPTIONS if item.long]
    texts = [text for value in typed for text in (value if isinstance(value, list) else [value])]
    return [*rest, *(text for text in texts if isinstance(text, str) and os.path.exists(text))]


def _arguments(item: Option, shown: bool = True) -> dict[str, Any]:
    """What argparse is told of an option. Its value stays a text until it is read: pytest-xdist
    sends it to its workers, and its ini twin is read by the same function."""
    # argparse formats help texts with %, in which ours mean nothing
    text = item.help.replace("%", "%%") if shown else argparse.SUPPRESS
    arguments: dict[str, Any] = {"dest": item.dest, "default": None, "help": text}
    if item.type is flag:
        return {**arguments, "action": "store_true"}
    if item.bare:
        arguments.update(nargs="?", const=True)
    return {**arguments, "metavar": item.metavar, "action": "append" if item.together else "store"}


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
