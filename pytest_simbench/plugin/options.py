"""Command-line options and their ini twins. Imported at plugin load: standard library only."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain
from typing import Any, Literal

import pytest

from pytest_simbench.cli import values as read
from pytest_simbench.cli.values import AUTO_LIMIT, MOST_REPETITIONS, BadValue
from pytest_simbench.records.tuned_on import FIRST_SEED


@dataclass(frozen=True)
class Option:
    """One option and its ini twin, which has the same name with underscores.

    Attributes:
        flag: as typed.
        type: makes the value of a text; `values.flag` is that of an option without a value.
        help: one sentence.
        default: when neither option nor ini says anything.
        metavar: placeholder of the value in the help.
        together: what several texts are put together with; None: the last one counts.
        ini: how pytest takes the ini value apart (`Parser.addini`); empty without an ini twin, of
            what concerns a single run.
        bare: it may stand without a value, which is True then.
        rare: it is on the page of options, and left out of `pytest --help`.
        long: what the short options of all simulators' tests are called where another plugin or a
            conftest has their name; empty for those that begin with `--sim-` anyway.
    """

    flag: str
    type: Callable[[str], Any]
    help: str
    default: Any = None
    metavar: str = ""
    together: Callable[[Iterator[Any]], Any] | None = None
    ini: Literal["string", "args", "linelist", ""] = "string"
    bare: bool = False
    rare: bool = False
    long: str = ""

    @property
    def sure(self) -> str:
        """The name that begins with `--sim-`."""
        return self.long or self.flag

    @property
    def name(self) -> str:
        """By which the code asks for its value."""
        return name_of(self.sure)

    @property
    def dest(self) -> str:
        """What argparse calls it; nobody else's."""
        return f"simbench_{self.name}"

    @property
    def ini_names(self) -> tuple[str, ...]:
        """What its ini twin may be called: as the flag is, or by its sure name."""
        return tuple(dict.fromkeys(map(name_of, (self.flag, self.sure)))) if self.ini else ()

    def value(self, texts: Sequence[str]) -> Any:
        """What these texts say.

        Raises:
            BadValue: one says nothing that this option can be.
        """
        if self.together is None:
            return self.type(texts[-1])
        return self.together(chain.from_iterable(self.type(text) for text in texts or [""]))


def name_of(flag: str) -> str:
    """The ini name of a flag: `sim_jobs` of `--sim-jobs`."""
    return flag.lstrip("-").replace("-", "_")


OPTIONS = (
    Option("--sim", read.simulators, "simulators to run: names, or all (default: every installed "
           "one); NAME==VERSION is a release, NAME@PYTHON or NAME@LABEL=PYTHON your own build in "
           "that interpreter", [], "NAME", list, "args", long="--sim-name"),
    Option("--sim-install-missing", read.flag, "make the environments that the simulators of --sim "
           "need and that are not there", False),
    Option("--robot", read.robot, "robot that does the tasks: a name (simbench robots), a robot "
           "file (.toml), or all built-in ones (default: panda)", None, "NAME|FILE|all",
           long="--sim-robot"),
    Option("--policies", read.policies, "Python files of policies that the tests of "
           "suites/test_transfer.py ask (default: those of suites/policies); NAME is one of "
           "several in a file", None, "FILE[:NAME],...", list, "args", long="--sim-policies"),
    Option("--sim-scene", read.file, "scene (MJCF, URDF) that the fixture `scene_file` gives; "
           "alone it runs the tests of suites/test_scene.py", None, "FILE", ini=""),
    Option("--sim-history", read.releases, "run the last N releases of a simulator, missing ones "
           "are installed; :minor, the last of each minor version; what an earlier history here "
           "has recorded is not run again", None, "NAME:N[:minor]", ini=""),
    Option("--gui", read.flag, "run in the simulators' own windows", False, long="--sim-gui"),
    Option("--headless", read.flag, "run without windows (default; with --gui: both)", False,
           long="--sim-headless"),
    Option("--reps", read.repetitions, f"repetitions per test, at most {MOST_REPETITIONS} "
           "(default: the protocol's, 20), or auto: until each asserted claim is decided, at most "
           f"{AUTO_LIMIT}; auto:LIMIT", None, "N", long="--sim-reps"),
    Option("--protocol", read.choice("fast", "paper", "smoke"), "fast, as fast as possible; paper, "
           "as the study; smoke, smallest", "fast", "NAME", long="--sim-protocol"),
    Option("--jitter", read.JITTER, "scale of the start jitter, at most 1000; 1 is 1 mm "
           "and 1 degree, 0 is none", 1.0, "SCALE", long="--sim-jitter"),
    Option("--sim-seed", read.SEED, "seed of the first repetition; "
           "the next ones follow", FIRST_SEED, "SEED"),
    Option("--sim-timeout", read.SECONDS, "time-out of a repetition in seconds (default: the "
           "study's)", None, "SECONDS"),
    Option("--sim-stall-timeout", read.SECONDS, "longest silence of a worker in seconds", 60.0,
           "SECONDS", rare=True),
    Option("--sim-profile", read.profiles, "settings profile: default, tuned, real or a TOML "
           "file; several (default,tuned) make each test for each", ("tuned",), "NAME|FILE"),
    Option("--sim-sweep", read.steps, "make each test for several time steps: for these [s], or, "
           "without any, for six from four times the profile's own to an eighth of it", None,
           "STEP,...", ini="", bare=True),
    Option("--sim-set", read.settings, "change one setting: mysim.timestep=0.001", {},
           "SIM.SETTING=VALUE", read.each_once, "args"),
    Option("--sim-python", partial(read.assignment, form="SIM=PATH"), "interpreter of "
           "a simulator's worker: mysim=PATH; repeat the option for another one", {},
           "SIM=PATH", read.each_once, "linelist"),
    Option("--sim-spec", partial(read.assignment, form="SIM=SPEC"), "execnet "
           "specification of a simulator's worker; repeat the option for another one", {},
           "SIM=SPEC", read.each_once, "linelist", rare=True),
    Option("--sim-fresh", read.flag, "a new worker for each repetition even where starting is "
           "costly", False, rare=True),
    Option("--sim-jobs", read.jobs, "repetitions at once, in the whole run also with -n, at most "
           "256 (from 2 on records are marked contended), or auto: one for each core", 1, "N"),
    Option("--sim-cluster", read.address, "scheduler of a cluster whose nodes carry the "
           "repetitions out: tcp://head:8786 (docs/cluster.md)", None, "ADDRESS"),
    Option("--sim-memory-limit", read.Number(1, 1e9), "memory a worker may use before it is "
           "killed", None, "MB", rare=True),
    Option("--sim-output", read.file, "folder of the run (default: .simbench/TIME-ID)", None,
           "DIR"),
    Option("--sim-trace", read.choice("first", "first-and-failed", "retain-on-failure", "on",
           "off"), "keep the motion of joints and bodies, for replay and recordings: of the first "
           "repetition of each test at 50 Hz and of failed ones at 10 Hz (first-and-failed), of "
           "one of these (first, retain-on-failure), of all (on), of none (off)",
           "first-and-failed", "WHEN"),
    Option("--sim-record", read.choice("mcap"), "write each repetition's motion as a rosbag2 "
           "folder (MCAP), for Foxglove, PlotJuggler and ros2 bag", None, "FORMAT", rare=True),
    Option("--sim-pictures", read.flag, "take pictures with each simulator's own renderer, in a "
           "repetition that is not measured, for a contact sheet", False),
    Option("--sim-video", read.choice("off", "first", "on", "retain-on-failure"), "have each "
           "simulator film with its own renderer, as mp4: the first seed, in a repetition that is "
           "not measured (first), each repetition (on), each but only failed ones are kept "
           "(retain-on-failure)", "off", "WHEN"),
    Option("--sim-badge", read.file, "write the result as JSON for a badge of shields.io into this "
           "file", None, "FILE", rare=True),
    Option("--sim-threshold", read.thresholds, "change a threshold of the suites: placed=0.9", {},
           "METRIC=VALUE", read.each_once, "args"),
    Option("--sim-data", read.file, "folder of measured data sets (default: $SIMBENCH_DATA, else a "
           "cache of the user's)", None, "DIR"),
    Option("--sim-crashes", read.SHARE, "share of a test's repetitions that may crash: 0.1 "
           "(default: 0; a test fails when one crashed); 1 allows all", None, "SHARE"),
    Option("--sim-strict", read.flag, "claims that the repetitions do not decide fail, also those "
           "that are not judged because there are too few", False),
    Option("--sim-baseline", read.file, "run to compare with: a run folder, its records.jsonl, or "
           "a --benchmark-json file (default: the run that --benchmark-compare chooses); or a "
           "simulator of this run, with which its other versions are compared", None, "PATH|NAME"),
    Option("--sim-compare-fail", read.limits, "fail when a metric is significantly worse than in "
           "the baseline, and by more than this: placed:5%,ram:10%,rtf:20%", None,
           "METRIC:LIMIT,..."),
    Option("--sim-resume", read.file, "complete an interrupted run, without repeating what is "
           "recorded: its folder (default: --sim-output, else the newest in .simbench)", None,
           "RUN", ini="", bare=True),
)  # fmt: skip
"""All options. Only their tests know them besides this table; docs/options.md is made of it."""

_BY_NAME = {item.name: item for item in OPTIONS}


refusing = partial(read.refusing, kind=pytest.UsageError)
"""Makes usage errors of others in a block: `with refusing(OSError, "--sim-output"):`."""


INI: pytest.StashKey[frozenset[str]] = pytest.StashKey()
"""The names in the ini file that are ours; see `registration`."""

FLAGS: pytest.StashKey[Mapping[str, str]] = pytest.StashKey()
"""What is typed for each option here, by its name; none of an option that is somebody else's."""

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
    return getattr(config.option, option(name).dest, None) is not None


def _value(config: pytest.Config, item: Option) -> Any:
    if given(config, item.name):
        where, raw = config.stash[FLAGS][item.name], getattr(config.option, item.dest)
    else:
        where, raw = _ini(config, item)
    if raw is None or raw is True:  # True: a flag, or an option that stands without a value
        return item.default if raw is None else True
    try:
        return item.value(list(map(str, raw)) if isinstance(raw, list) else [str(raw)])
    except BadValue as error:
        raise pytest.UsageError(error.sentence(where)) from None


def _ini(config: pytest.Config, item: Option) -> tuple[str, Any]:
    """Name and value of the ini twin that is set, if one is."""
    for name in config.stash.get(INI, frozenset()).intersection(item.ini_names):
        # Not a text, or quotes that do not match.
        with refusing((TypeError, ValueError, pytest.UsageError), f"the ini option {name}"):
            raw = config.getini(name)
        if raw is not None:
            return f"the ini option {name}", raw
    return "", None


def mentioned(config: pytest.Config, names: Sequence[str]) -> bool:
    """Whether one of these options is on the command line or in the ini file."""
    return any(given(config, name) or _ini(config, option(name))[1] is not None for name in names)


def from_root(config: pytest.Config, typed: str) -> str:
    """A file's path for commands that are run in pytest's root folder, as the command of a report
    is: as it was typed where the run was begun there."""
    here = config.invocation_params.dir
    return typed if here == config.rootpath else str(here / typed)


def taken_names(config: pytest.Config) -> list[str]:
    """What of our names on the command line belongs to others here, and how to write it; one
    sentence each."""
    ours = config.stash.get(FLAGS, {})
    return [
        f"{item.flag} belongs to another plugin or to a conftest here"
        + (f": write {ours[item.name]} for this one's" if item.name in ours else "")
        for item in OPTIONS
        if ours.get(item.name) != item.flag
    ]
