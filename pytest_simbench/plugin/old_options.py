"""The options of release 0.1 that do their work and exit. They are commands now, `simbench merge`
for `--sim-merge`; for one release they still work, and name the command.

Imported at plugin load: standard library and pytest only.
"""

from __future__ import annotations

import argparse
import shlex
import sys
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from pytest_simbench.plugin import options


class OldOption(NamedTuple):
    """An old option, the command that it stands for, and how many values it takes."""

    flag: str
    command: str
    values: int | str = 0

    @property
    def arguments(self) -> dict[str, Any]:
        """What argparse is told of it."""
        more = (
            {"action": "extend", "nargs": self.values} if self.values else {"action": "store_true"}
        )
        return {"dest": self.flag, "default": None, "help": argparse.SUPPRESS, **more}


OLD_OPTIONS = (
    OldOption("--sim-install", "install", 1),
    OldOption("--sim-uninstall", "uninstall", 1),
    OldOption("--sim-environments", "environments"),
    OldOption("--sim-download", "download", 1),
    OldOption("--sim-bisect", "bisect", 2),
    OldOption("--sim-merge", "merge", "+"),
    OldOption("--sim-report", "report", "+"),
    OldOption("--sims", "list"),
    OldOption("--sim-list", "list"),
    OldOption("--robots", "robots"),
    OldOption("--sim-robots", "robots"),
)
"""The first one that is given counts."""

CARRIED = {"sim_output": "--output", "sim_badge": "--badge", "sim_record": "--record",
           "sim_data": "--data", "sim_cluster": "--cluster"}  # fmt: skip
"""Options of runs, by what those commands call them that take them too."""


def asked(config: pytest.Config) -> OldOption | None:
    """The first of the old options that is on the command line."""
    return next((old for old in OLD_OPTIONS if getattr(config.option, old.flag, None)), None)


def run_command(config: pytest.Config, old: OldOption) -> int:
    """Do what an old option asks for, by the command; the exit code, as pytest has it."""
    from pytest_simbench.cli.main import BAD_INPUT, COMMANDS, INTERRUPTED, main

    values = getattr(config.option, old.flag)
    if old.command == "bisect":
        return _bisect(config, *values)
    (command,) = (command for command in COMMANDS if command.name == old.command)
    words = [command.name]
    for value in values if old.values else ():
        words += value.split(",") if old.values == 1 else [value]
    robot = options.value(config, "sim_robot")
    if command.name == "robots" and robot not in (None, "all"):
        words.append(robot)
    taken = {argument.name for argument in command.arguments}
    for name, own in CARRIED.items():
        if own in taken and options.value(config, name) is not None:
            words += [own, options.value(config, name)]
    if command.name == "list" or (command.verbose and config.get_verbosity() > 0):
        words.append("-v")
    _announce(old.flag, words)
    status = main(words)
    if command.name == "list":
        for line in options.taken_names(config):
            print(line)
    as_pytest = {BAD_INPUT: pytest.ExitCode.USAGE_ERROR, INTERRUPTED: pytest.ExitCode.INTERRUPTED}
    return as_pytest.get(status, status)


def _announce(flag: str, words: list[str]) -> None:
    command = shlex.join(["simbench", *words])
    print(f"{flag} will go with the next release; write: {command}", file=sys.stderr)


def _bisect(config: pytest.Config, span: str, metric: str) -> int:
    """The one that `simbench bisect` itself asks for: which folder it is, the options say."""
    from pytest_simbench.cli import bisect, values
    from pytest_simbench.ground.errors import SimulatorError
    from pytest_simbench.plugin.history import folder_of

    words = list(config.invocation_params.args)
    place = words.index("--sim-bisect")
    rest = [*words[:place], *words[place + 3 :]]
    if not config.pluginmanager.is_registered(bisect):
        _announce("--sim-bisect", ["bisect", span, metric, *rest])
    with options.refusing((values.BadInput, SimulatorError), "simbench bisect"):
        wanted, metric = values.span(span), values.metric(metric)
        given = options.value(config, "sim_output")
        here = config.invocation_params.dir
        folder = Path(here, given) if given else folder_of(config, wanted.name)
        return bisect.bisect(wanted, metric, folder, rest)
