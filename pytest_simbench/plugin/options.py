"""Command-line options and their ini twins. Imported at plugin load: standard library only."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import pytest

from pytest_simbench.plugin.values import (
    Address,
    Assignments,
    BadValue,
    Bisection,
    Choice,
    File,
    Files,
    Flag,
    Jobs,
    Kind,
    LastReleases,
    Limits,
    Number,
    Profiles,
    Repetitions,
    Simulators,
    Steps,
    Words,
)
from pytest_simbench.plugin.values import Auto as Auto
from pytest_simbench.records.choices import FIRST_SEED

AUTO_LIMIT = 160
"""Repetitions at which `--reps auto` gives up: with the looks before it 10, 20, 40, 80 and 160."""

MOST_REPETITIONS = 100_000
"""At a second each they take more than a day; a larger number is a slip of the hand."""

LARGEST_SEED = 2**53 - MOST_REPETITIONS - 1
"""The seed of every repetition is then a whole number that any reader of JSON keeps."""

LONGEST = 1e6
"""Of all time-outs [s]: eleven days."""

SECONDS = Number(0.001, LONGEST)


@dataclass(frozen=True)
class Option:
    """One option and its ini twin, which has the same name with underscores.

    Attributes:
        flag: as typed; begins with `--sim-`.
        kind: what its values may be.
        help: one sentence.
        default: when neither option nor ini says anything.
        short: what it is called besides, where no other plugin and no conftest has that name.
        metavar: placeholder of the value in the help.
        ini: whether it has an ini twin; what concerns a single run has none.
        arguments: for argparse, of an option that takes its values in its own way.
    """

    flag: str
    kind: Kind
    help: str
    default: Any = None
    short: str = ""
    metavar: str | tuple[str, ...] | None = None
    ini: bool = True
    arguments: Mapping[str, Any] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """By which the code asks for its value; also the ini twin's name."""
        return name_of(self.flag)

    @property
    def flags(self) -> tuple[str, ...]:
        """Everything that may be typed for it, the sure one first."""
        return tuple(filter(None, (self.flag, self.short)))


def name_of(flag: str) -> str:
    """The ini name of a flag: `sim_jobs` of `--sim-jobs`."""
    return flag.lstrip("-").replace("-", "_")


OPTIONS = (
    Option("--sim-name", Simulators(), "simulators to run: names, or all (default: every installed "
           "one); NAME==VERSION is a release of it, NAME@PYTHON or NAME@LABEL=PYTHON a build of "
           "your own in that interpreter", [], "--sim", "NAME"),
    Option("--sim-install-missing", Flag(), "before the run, make the environments that the "
           "simulators of --sim need and that are not there", False),
    Option("--sim-robot", File("a name (pytest --robots), a robot file, or all"),
           "robot that does the tasks: a name (pytest --robots), a robot file that ends in .toml, "
           "or all built-in ones (default: panda)", None, "--robot", "NAME|FILE|all"),
    Option("--sim-history", LastReleases(), "run the last N releases of a simulator, each in an "
           "environment of its own that is made where it is missing; :minor, the last of each "
           "minor version; what an earlier history here has recorded is not run again",
           metavar="NAME:N[:minor]", ini=False),
    Option("--sim-gui", Flag(), "run in the simulators' own windows", False, "--gui"),
    Option("--sim-headless", Flag(), "run without windows (default; with --sim-gui: both)", False,
           "--headless"),
    Option("--sim-reps", Repetitions(MOST_REPETITIONS, AUTO_LIMIT), "repetitions per test, at most "
           f"{MOST_REPETITIONS} (default: the protocol's, 20), or auto: until each asserted claim "
           f"is decided, at most {AUTO_LIMIT}; auto:LIMIT", None, "--reps", "N"),
    Option("--sim-protocol", Choice(("fast", "paper", "smoke")), "fast, as fast as possible; "
           "paper, as the study; smoke, smallest", "fast", "--protocol", "NAME"),
    Option("--sim-jitter", Number(0, 1000), "scale of the start jitter, at most 1000; 1 is 1 mm "
           "and 1 degree, 0 is none", 1.0, "--jitter", "SCALE"),
    Option("--sim-seed", Number(0, LARGEST_SEED, whole=True), "seed of the first repetition; the "
           "next ones follow", FIRST_SEED, metavar="SEED"),
    Option("--sim-timeout", SECONDS, "time-out of a repetition in seconds (default: the study's)",
           metavar="SECONDS"),
    Option("--sim-stall-timeout", SECONDS, "longest silence of a worker in seconds", 60.0,
           metavar="SECONDS"),
    Option("--sim-profile", Profiles(), "settings profile: default, tuned or real; several "
           "(default,tuned) make each test for each", ("tuned",), metavar="NAME"),
    Option("--sim-sweep", Steps(), "make each test for several time steps: for these [s], or, "
           "without any, for six from four times the profile's own to an eighth of it",
           metavar="STEP,...", ini=False, arguments={"nargs": "?", "const": True}),
    Option("--sim-set", Assignments("SIM.SETTING=VALUE"), "change one setting: "
           "mysim.timestep=0.001", {}, metavar="SIM.SETTING=VALUE"),
    Option("--sim-python", Assignments("SIM=PATH", commas=False), "interpreter of a simulator's "
           "worker: mysim=PATH; repeat the option for another one", {}, metavar="SIM=PATH"),
    Option("--sim-spec", Assignments("SIM=SPEC", commas=False), "execnet specification of a "
           "simulator's worker; repeat the option for another one", {}, metavar="SIM=SPEC"),
    Option("--sim-fresh", Flag(), "a new worker for each repetition even where starting is costly",
           False),
    Option("--sim-jobs", Jobs(256), "repetitions at once, in the whole run also with -n, at most "
           "256 (from 2 on records are marked contended), or auto: one for each core", 1,
           metavar="N"),
    Option("--sim-cluster", Address(), "scheduler of a cluster whose nodes carry the repetitions "
           "out: tcp://head:8786 (docs/cluster.md)", metavar="ADDRESS"),
    Option("--sim-memory-limit", Number(1, 1e9), "memory a worker may use before it is killed",
           metavar="MB"),
    Option("--sim-output", File(), "folder of the run (default: .simbench/TIME-ID)", metavar="DIR"),
    Option("--sim-trace", Choice(("first", "first-and-failed", "retain-on-failure", "on", "off")),
           "keep the motion of joints and bodies, for replay and recordings: of the first "
           "repetition of each test at 50 Hz and of failed ones at 10 Hz (first-and-failed), of "
           "one of these (first, retain-on-failure), of all (on), of none (off)",
           "first-and-failed", metavar="WHEN"),
    Option("--sim-record", Choice(("mcap",)), "write each repetition's motion as a rosbag2 folder "
           "(MCAP), for Foxglove, PlotJuggler and ros2 bag", metavar="FORMAT"),
    Option("--sim-pictures", Flag(), "take pictures with each simulator's own renderer, in a "
           "repetition that is not measured, for a contact sheet", False),
    Option("--sim-video", Choice(("off", "first", "on", "retain-on-failure")), "have each "
           "simulator film with its own renderer, as mp4: the first seed, in a repetition that is "
           "not measured (first), each repetition (on), each but only failed ones are kept "
           "(retain-on-failure)", "off", metavar="WHEN"),
    Option("--sim-badge", File(), "write the result as JSON for a badge of shields.io into this "
           "file", metavar="FILE"),
    Option("--sim-threshold", Assignments("METRIC=NUMBER", numbers=True), "change a threshold of "
           "the suites: placed=0.9", {}, metavar="METRIC=VALUE"),
    Option("--sim-data", File(), "folder of measured data sets (default: $SIMBENCH_DATA, else a "
           "cache of the user's)", metavar="DIR"),
    Option("--sim-crashes", Number(0, 1), "share of a test's repetitions that may crash: 0.1 "
           "(default: 0; a test fails when one crashed); 1 allows all", metavar="SHARE"),
    Option("--sim-strict", Flag(), "claims that the repetitions do not decide fail, also those "
           "that are not judged because there are too few", False),
    Option("--sim-baseline", File(), "run to compare with: a run folder, its records.jsonl, or a "
           "--benchmark-json file (default: the run that --benchmark-compare chooses); or a "
           "simulator of this run, with which its other versions are compared",
           metavar="PATH|NAME"),
    Option("--sim-compare-fail", Limits(), "fail when a metric is significantly worse than in the "
           "baseline, and by more than this: placed:5%,ram:10%,rtf:20%",
           metavar="METRIC:LIMIT,..."),
    Option("--sim-resume", File(), "complete an interrupted run, without repeating what is "
           "recorded: its folder (default: --sim-output, else the newest in .simbench)",
           metavar="RUN", ini=False, arguments={"nargs": "?", "const": True}),
    Option("--sim-merge", Files(), "join runs with different seeds (--sim-seed), made on several "
           "machines for instance, into one in --sim-output, and exit", metavar="RUN", ini=False,
           arguments={"nargs": "+", "action": "extend"}),
    Option("--sim-report", Files(), "print the tables and write the report of runs again, from "
           "their folders alone, and exit; several are merged, and written where --sim-output says",
           metavar="RUN", ini=False, arguments={"nargs": "+", "action": "extend"}),
    Option("--sim-bisect", Bisection(), "run the tests on releases between a good and a bad one to "
           "find the first in which METRIC is worse, and exit",
           metavar=("NAME:GOOD..BAD", "METRIC"), ini=False,
           arguments={"nargs": 2, "action": "store"}),
    Option("--sim-list", Flag(), "list the known simulators and exit", False, "--sims", ini=False),
    Option("--sim-robots", Flag(), "list the known robots, check the one of --robot, and exit",
           False, "--robots", ini=False),
    Option("--sim-install", Words(), "make the environment of a simulator that needs one of its "
           "own, or of a release (NAME==VERSION), and exit", metavar="NAME", ini=False),
    Option("--sim-uninstall", Words(), "remove such environments and exit", metavar="NAME",
           ini=False),
    Option("--sim-download", Words(), "bring a measured data set from its public source into the "
           "folder of --sim-data, and exit", metavar="NAME", ini=False),
    Option("--sim-environments", Flag(), "list the environments that are there, with their sizes, "
           "and exit", False, ini=False),
)  # fmt: skip
"""All options. Only their tests know them besides this table; docs/options.md is made of it."""

COMMANDS = (
    "sim_install", "sim_uninstall", "sim_environments", "sim_download", "sim_bisect", "sim_merge",
    "sim_report", "sim_list", "sim_robots",
)  # fmt: skip
"""Options that do their work and exit, see `plugin.commands`."""

_BY_NAME = {item.name: item for item in OPTIONS}


@contextmanager
def refusing(
    errors: type[Exception] | tuple[type[Exception], ...], where: str = ""
) -> Iterator[None]:
    """Make usage errors of these errors in this block, in their own words, after `WHERE: `."""
    try:
        yield
    except errors as error:
        raise pytest.UsageError(f"{where}: {error}" if where else str(error)) from None


OURS: pytest.StashKey[frozenset[str]] = pytest.StashKey()
"""What is ours of the names on the command line (`--gui`) and in the ini file (`gui`)."""

_VALUES: pytest.StashKey[Mapping[str, Any]] = pytest.StashKey()


def option(name: str) -> Option:
    """The option of that name."""
    return _BY_NAME[name]


def values(config: pytest.Config) -> Mapping[str, Any]:
    """The values of all options, checked once: from the command line, else the ini file, else the
    default.

    Raises:
        pytest.UsageError: a value that its option cannot take; one sentence.
    """
    if _VALUES not in config.stash:
        config.stash[_VALUES] = {item.name: _value(config, item) for item in OPTIONS}
    return config.stash[_VALUES]


def value(config: pytest.Config, name: str) -> Any:
    """The value of one option. All are checked, whichever is asked for first.

    Raises:
        pytest.UsageError: a value that its option cannot take; one sentence.
    """
    return values(config)[name]


def given(config: pytest.Config, name: str) -> bool:
    """Whether an option is on the command line."""
    return option(name).flag in _ours(config) and config.getoption(name) is not None


def _ours(config: pytest.Config) -> frozenset[str]:
    return config.stash.get(OURS, frozenset())


def _value(config: pytest.Config, item: Option) -> Any:
    name = item.short if item.short in _ours(config) else item.flag
    raw = config.getoption(item.name) if given(config, item.name) else None
    if raw is True:  # a flag, or an option that may stand without a value
        return True
    if raw is None:
        name, raw = _ini(config, item)
    if raw is None:
        return item.default
    texts = list(map(str, raw)) if isinstance(raw, list) else [str(raw)]
    try:
        return item.kind.read(texts)
    except BadValue as error:
        raise pytest.UsageError(error.sentence(name)) from None


def _ini(config: pytest.Config, item: Option) -> tuple[str, Any]:
    """Name and value of the ini twin that is set, if one is."""
    for name in map(name_of, item.flags if item.ini else ()):
        if name in _ours(config):
            # Not a text, or quotes that do not match.
            with refusing((TypeError, ValueError, pytest.UsageError), f"the ini option {name}"):
                raw = config.getini(name)
            if raw is not None:
                return f"the ini option {name}", raw
    return "", None


def repetitions(config: pytest.Config) -> int | Auto | None:
    """What `--reps` asks for; None when it is not given."""
    found: int | Auto | None = value(config, "sim_reps")
    return found


def number(name: str, value: Any) -> Any:
    """A number from a mark, within the bounds of the option `name`.

    Raises:
        BadValue: it is none.
    """
    kind = option(name).kind
    if isinstance(kind, Repetitions):
        kind = Number(1, kind.most, whole=True)
    assert isinstance(kind, Number)
    return kind.check(value)


def mentioned(config: pytest.Config, names: Sequence[str]) -> bool:
    """Whether one of these options is on the command line or in the ini file."""
    return any(given(config, name) or _ini(config, option(name))[1] is not None for name in names)
