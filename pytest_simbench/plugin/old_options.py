"""The options of release 0.1 that do their work and exit. They are commands now, `simbench merge`
for `--sim-merge`; for one release they still work, and name the command.

Imported at plugin load: standard library and pytest only.
"""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import pytest

from pytest_simbench.plugin import options


@dataclass(frozen=True)
class OldOption:
    """What an old option stands for.

    Attributes:
        flag: the option.
        name: of the command.
        values: how many values the option takes, as argparse has it; 0 for none.
        carried: options of a run that were for the option too, by what the command calls them.
    """

    flag: str
    name: str
    values: int | str = 0
    carried: Mapping[str, str] = field(default_factory=dict)

    @property
    def dest(self) -> str:
        """What argparse calls its values."""
        return f"simbench_command{self.flag}"

    @property
    def arguments(self) -> dict[str, Any]:
        """What argparse is told of it."""
        taken = (
            {"action": "extend", "nargs": self.values} if self.values else {"action": "store_true"}
        )
        return {"dest": self.dest, "default": None, "help": argparse.SUPPRESS, **taken}


_RUNS = {"sim_output": "--output", "sim_badge": "--badge", "sim_record": "--record"}

OLD_OPTIONS = (
    OldOption("--sim-install", "install", 1),
    OldOption("--sim-uninstall", "uninstall", 1),
    OldOption("--sim-environments", "environments"),
    OldOption("--sim-download", "download", 1, {"sim_data": "--data"}),
    OldOption("--sim-bisect", "bisect", 2),
    OldOption("--sim-merge", "merge", "+", _RUNS),
    OldOption("--sim-report", "report", "+", _RUNS),
    OldOption("--sims", "list", 0, {"sim_cluster": "--cluster"}),
    OldOption("--sim-list", "list", 0, {"sim_cluster": "--cluster"}),
    OldOption("--robots", "robots"),
    OldOption("--sim-robots", "robots"),
)
"""The first one that is given counts."""


def asked(config: pytest.Config) -> OldOption | None:
    """The first of the old options that is on the command line."""
    given = (found for found in OLD_OPTIONS if getattr(config.option, found.dest, None))
    return next(given, None)


def run_command(config: pytest.Config, command: OldOption) -> int:
    """Do what an old option asks for, by the command; the exit code, as pytest has it."""
    from pytest_simbench.cli.main import BAD_INPUT, INTERRUPTED, main

    values = getattr(config.option, command.dest)
    if command.name == "bisect":
        return _bisect(config, *values)
    names = "," if command.values == 1 else None  # in one value, as options have them
    words = [command.name]
    for value in [] if values is True else values:
        words += value.split(names) if names else [value]
    if command.name == "robots" and options.value(config, "sim_robot") not in (None, "all"):
        words.append(options.value(config, "sim_robot"))
    for name, own in command.carried.items():
        if (value := options.value(config, name)) is not None:
            words += [own, value]
    if command.name == "list" or (command.carried is _RUNS and config.get_verbosity() > 0):
        words.append("-v")
    _announce(command.flag, words)
    status = main(words)
    if command.name == "list":
        print("\n".join(options.taken_names(config)))
    return {BAD_INPUT: pytest.ExitCode.USAGE_ERROR, INTERRUPTED: pytest.ExitCode.INTERRUPTED}.get(
        status, status
    )


def _announce(flag: str, words: list[str]) -> None:
    command = shlex.join(["simbench", *words])
    print(f"{flag} will go with the next release; write: {command}", file=sys.stderr)


def _bisect(config: pytest.Config, span: str, metric: str) -> int:
    """The one that `simbench bisect` itself asks for: which folder it is, the options say."""
    from pathlib import Path

    from pytest_simbench.cli import bisect, values
    from pytest_simbench.plugin.history import folder_of
    from pytest_simbench.simulator.errors import SimulatorError

    words = list(config.invocation_params.args)
    place = words.index("--sim-bisect")
    rest = [w for w in [*words[:place], *words[place + 3 :]] if not w.startswith("--sim-output=")]
    if not config.pluginmanager.is_registered(bisect):
        _announce("--sim-bisect", ["bisect", span, metric, *rest])
    with options.refusing((values.BadInput, SimulatorError), "simbench bisect"):
        wanted, metric = values.span(span), values.metric(metric)
        given = options.value(config, "sim_output")
        here = config.invocation_params.dir
        folder = Path(here, given) if given else folder_of(config, wanted.name)
        return bisect.bisect(wanted, metric, folder, rest)
