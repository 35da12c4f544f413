"""Command-line options and their ini twins. Imported at plugin load: standard library only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest


@dataclass(frozen=True)
class Option:
    """One option; its ini twin has the same name with underscores.

    Attributes:
        flag: as typed.
        default: when neither option nor ini says anything.
        help: one sentence.
        kind: `text`, `int`, `float`, `flag`, or `list` (repeatable, comma separated).
        metavar: placeholder of the value in the help.
        choices: valid values, if they are few.
    """

    flag: str
    default: Any
    help: str
    kind: str = "text"
    metavar: str | None = None
    choices: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        return self.flag.lstrip("-").replace("-", "_")


OPTIONS = (
    Option("--sim", [], "simulators to run: names, or all (default: every installed one)",
           "list", "NAME"),
    Option("--gui", False, "run in the simulators' own windows", "flag"),
    Option("--headless", False, "run without windows (default; with --gui: both)", "flag"),
    Option("--reps", None, "repetitions per test (default: the protocol's, 20), or auto: until "
           "each asserted claim is decided, at most 160; auto:LIMIT", "text", "N"),
    Option("--protocol", "fast", "fast, as fast as possible; paper, as the study; smoke, smallest",
           "text", "NAME", ("fast", "paper", "smoke")),
    Option("--jitter", 1.0, "scale of the start jitter; 1 is 1 mm and 1 degree, 0 is none",
           "float", "SCALE"),
    Option("--sim-seed", 2022, "seed of the first repetition; the next ones follow", "int", "SEED"),
    Option("--sim-timeout", None, "time-out of a repetition in seconds (default: the study's)",
           "float", "SECONDS"),
    Option("--sim-stall-timeout", 60.0, "longest silence of a worker in seconds", "float",
           "SECONDS"),
    Option("--sim-profile", "tuned", "settings profile, default or tuned", "text", "NAME"),
    Option("--sim-set", [], "change one setting: mujoco.timestep=0.001", "list",
           "SIM.SETTING=VALUE"),
    Option("--sim-python", [], "interpreter of a simulator's worker: genesis=PATH", "list",
           "SIM=PATH"),
    Option("--sim-spec", [], "execnet specification of a simulator's worker", "list", "SIM=SPEC"),
    Option("--sim-fresh", False, "a new worker for each repetition even where starting is costly",
           "flag"),
    Option("--sim-jobs", 1, "repetitions in parallel workers (records are marked contended)",
           "int", "N"),
    Option("--sim-memory-limit", None, "memory a worker may use before it is killed", "float",
           "MB"),
    Option("--sim-output", None, "folder of the run (default: .simbench/TIME-ID)", "text", "DIR"),
    Option("--sim-trace", "off", "write joint and body motion at 50 Hz into the run folder",
           "text", "WHEN", ("off", "on", "retain-on-failure")),
    Option("--sim-threshold", [], "change a threshold of the suites: placed=0.9", "list",
           "METRIC=VALUE"),
    Option("--sim-baseline", None, "run to compare with: a run folder, its records.jsonl, or a "
           "--benchmark-json file (default: the run that --benchmark-compare chooses)",
           "text", "PATH"),
    Option("--sim-compare-fail", None, "fail when a metric is significantly worse than in the "
           "baseline, and by more than this: placed:5%,ram:10%,rtf:20%",
           "text", "METRIC:LIMIT,..."),
)  # fmt: skip
"""Every option that is a setting; those of a single run are added apart and have no ini twin."""

AUTO_LIMIT = 160
"""Repetitions at which `--reps auto` gives up: with the looks before it 10, 20, 40, 80 and 160."""


@dataclass(frozen=True)
class Auto:
    """`--reps auto`: repeat until the claims are decided, at most `limit` times."""

    limit: int = AUTO_LIMIT


def add_options(parser: pytest.Parser) -> None:
    """Register all options and ini twins."""
    group = parser.getgroup("simbench", "comparison of robot simulators")
    for option in OPTIONS:
        arguments: dict[str, Any] = {"help": option.help, "default": None, "dest": option.name}
        if option.kind == "flag":
            arguments["action"] = "store_true"
        else:
            arguments["metavar"] = option.metavar
            if option.kind == "list":
                arguments["action"] = "append"
        group.addoption(option.flag, **arguments)
        parser.addini(option.name, option.help, default=None)
    group.addoption(
        "--sim-resume",
        nargs="?",
        const="",
        metavar="RUN",
        help="complete an interrupted run, without repeating what is recorded: its folder "
        "(default: --sim-output, else the newest in .simbench)",
    )
    group.addoption(
        "--sim-merge",
        nargs="+",
        metavar="RUN",
        help="join runs with different seeds (--sim-seed), made on several machines for instance, "
        "into one in --sim-output, and exit",
    )
    group.addoption(
        "--sims", action="store_true", help="list the known simulators and exit", dest="sims_list"
    )
    group.addoption(
        "--sim-install",
        action="append",
        metavar="NAME",
        help="make the environment of a simulator that needs one of its own, and exit",
    )


def value(config: pytest.Config, name: str) -> Any:
    """The value of an option: from the command line, else its ini twin, else its default.

    Raises:
        pytest.UsageError: a value of the wrong type or none of the choices.
    """
    option = next(option for option in OPTIONS if option.name == name)
    given = config.getoption(name)
    if given is None:
        given = config.getini(name) or None
    if given is None:
        return option.default
    if option.kind == "flag":
        return given is True or str(given).lower() in ("1", "true", "on", "yes")
    if option.kind == "list":
        texts = given if isinstance(given, list) else str(given).split()
        return [part.strip() for text in texts for part in text.split(",") if part.strip()]
    if option.kind in ("int", "float"):
        convert, noun = (int, "whole number") if option.kind == "int" else (float, "number")
        try:
            return convert(given)
        except ValueError:
            raise pytest.UsageError(f"{option.flag} takes a {noun}, not {given!r}") from None
    if option.choices and given not in option.choices:
        raise pytest.UsageError(f"{option.flag} {given}: choose from {', '.join(option.choices)}")
    return given


def repetitions(config: pytest.Config) -> int | Auto | None:
    """What `--reps` asks for; None when it is not given.

    Raises:
        pytest.UsageError: neither a number nor auto, or less than 1.
    """
    text = value(config, "reps")
    if text is None:
        return None
    word, colon, limit = str(text).strip().partition(":")
    auto = word == "auto"
    if auto and not colon:
        return Auto()
    try:
        number = int(limit if auto else text)
    except ValueError:
        raise pytest.UsageError(
            f"--reps takes a whole number, auto or auto:LIMIT, not {text!r}"
        ) from None
    if number < 1:
        raise pytest.UsageError(f"--reps {text}: give at least 1")
    return Auto(number) if auto else number


def assignments(config: pytest.Config, name: str) -> dict[str, str]:
    """A list option of `key=value` texts as a dict.

    Raises:
        pytest.UsageError: a text without `=`.
    """
    option = next(option for option in OPTIONS if option.name == name)
    result = {}
    for text in value(config, name):
        key, equals, right = text.partition("=")
        if not (equals and key and right):
            raise pytest.UsageError(f"{option.flag} {text}: write it as {option.metavar}")
        result[key.strip()] = right.strip()
    return result
