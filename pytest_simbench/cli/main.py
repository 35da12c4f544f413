"""The command `simbench`: its arguments, and what is said of wrong ones.

What a command needs is imported when it runs: `simbench --help` answers at once.
"""

from __future__ import annotations

import argparse
import errno
import os
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any, NamedTuple, NoReturn

from pytest_simbench.cli import values as read

BAD_INPUT = 2
"""Exit code, as argparse has it."""

INTERRUPTED = 130
"""Exit code, as shells have it."""


class Argument(NamedTuple):
    """An argument of a command, as argparse has it; its name is that of the parameter that takes
    the values."""

    name: str
    type: Callable[[str], Any] | None = None
    metavar: str | None = None
    help: str = ""
    nargs: str | None = None
    action: str | None = None


class Subcommand(NamedTuple):
    """A command.

    Attributes:
        name: with a group's before it, where there is one.
        function: `module:name` of what does the work. It takes the arguments by their names.
        more: a second sentence for its own help.
        verbose: what -v adds; empty for a command without it.
    """

    name: str
    function: str
    help: str
    more: str = ""
    arguments: tuple[Argument, ...] = ()
    verbose: str = ""


_OF_RUNS = (
    Argument("runs", read.file, "RUN", "folder of a run", "+"),
    Argument("--output", read.file, "DIR", "folder to write to (default: of one run its own, of "
             "merged ones a new one; report writes nothing of several then)"),
    Argument("--badge", read.file, "FILE", "write the result as JSON for a badge of shields.io"),
    Argument("--record", read.choice("mcap"), "mcap", "write each repetition's motion as a rosbag2 "
             "folder"),
)  # fmt: skip

COMMANDS = (
    Subcommand("list", "cli.simulators:list_simulators", "list the simulators, which are ready "
            "here, and how to get the others", "", (
                Argument("names", read.simulator, "NAME", "say of this one what it is, where it "
                         "is, and how to get it; NAME==VERSION is a release", "*"),
                Argument("--settings", read.simulator, "SIM", "print the settings of this "
                         "simulator, what simbench tune may search, and what they are"),
                Argument("--cluster", read.address, "ADDRESS", "ask the nodes of this cluster "
                         "instead of this machine"),
            ), "tell what each can do, and where it deviates from a scene"),
    Subcommand("robots", "cli.robots:list_robots", "list the robots, and check robot files", "",
            (Argument("names", read.robot, "NAME|FILE", "tell of this one alone", "*"),)),
    Subcommand("install", "cli.environments:install", "make the environment of a simulator that "
            "needs one of its own", "The others come with pip, as extras of this package.",
            (Argument("names", read.word, "NAME", "a simulator, or a release: NAME==VERSION",
                      "+"),)),
    Subcommand("uninstall", "cli.environments:uninstall", "remove such environments", "",
            (Argument("names", read.word, "NAME", "as simbench environments lists it", "+"),)),
    Subcommand("environments", "cli.environments:list_environments", "list the environments that "
            "are there, with their sizes"),
    Subcommand("download", "cli.environments:download", "bring a measured data set from its public "
            "source", "", (
                Argument("names", read.word, "NAME", "of a data set", "+"),
                Argument("--data", read.file, "DIR", "folder to bring it to (default: "
                         "$SIMBENCH_DATA, else a cache of the user's)"),
            )),
    Subcommand("merge", "cli.runs:merge_runs", "join runs with different seeds, made on several "
            "machines, into one", "", _OF_RUNS, "print whole tables"),
    Subcommand("report", "cli.runs:report_runs", "print the tables and write the report of runs "
            "again", "Their folders are enough. Several are merged first.", _OF_RUNS,
            "print whole tables"),
    Subcommand("bisect", "cli.bisect:start", "find the release in which a metric becomes worse",
            "It runs the tests on releases between a good and a bad one.", (
                Argument("span", read.span, "NAME:GOOD..BAD", "a simulator and two releases"),
                Argument("metric", read.metric, "METRIC", "that is worse in BAD"),
                Argument("arguments", str, "...", "tests and options of pytest",
                         argparse.REMAINDER),
            )),
    Subcommand("watch", "cli.watch:watch", "run laws, tasks and scenes on releases that are new",
            "It compares each with the one before it, writes a page, and ends with 1 where a "
            "change is certain and larger than its limit, with 2 where something could not be "
            "judged. The first run notes the newest releases.", (
                Argument("engines", read.word, "NAME", "simulators (default: each that a package "
                         "index has)", "*"),
                Argument("--since", read.word, "NAME==RELEASE[:minor]", "all releases after this "
                         "one, of each minor version the last; may come several times",
                         action="append"),
                Argument("--scene", read.file, "FILE", "a scene (MJCF, URDF) to run, too; may come "
                         "several times", action="append"),
                Argument("--reps", read.REPETITIONS, "N", "of both tasks (default: 12)"),
                Argument("--limit", read.limits, "METRIC:LIMIT,...", "of the tasks' outcomes and "
                         "costs (default: placed:5%%,hit:20%%,cpu_cost:20%%)"),
                Argument("--output", read.file, "DIR", "folder of all runs, the page, and what was "
                         "seen (default: .simbench/watch)"),
            )),
    Subcommand("tune", "cli.tune:tune", "search settings that give this truth for the least cost",
            "It searches for three quarters of the budget, and judges on what it did not search "
            "by. The same command goes on where it was interrupted.", (
                Argument("target", read.file, "TARGET", "a test, FILE.py::TEST; laws, or "
                         "laws:NAME,... (laws or phenomena); stacking, throwing or pushing; "
                         "measured data: tosses, impacts, pushes, commands; or several of these, "
                         "NAME,NAME:METRIC,laws:NAME,..."),
                Argument("--sim", read.simulators, "NAME,...", "whose settings, or all, one search "
                         "after the other; simbench list --settings NAME prints them"),
                Argument("--profile", read.profiles, "NAME|FILE", "today's (default: tuned)"),
                Argument("--settings", read.words, "NAME,...", "search these alone"),
                Argument("--cost", read.word, "COST", "default: cpu_cost"),
                Argument("--error", read.word, "METRIC", "of a task (default: its own; of a test "
                         "its claims); converged or converged:METRIC is the distance to an eighth "
                         "of the time step"),
                Argument("--budget", read.duration, "TIME", "of all (default: 30min)"),
                Argument("--trials", read.REPETITIONS, "N", "at most"),
                Argument("--seeds", read.REPETITIONS, "N", "of a task, to choose by (default: 4; "
                         "of measured data 24)"),
                Argument("--seed", read.SEED, "SEED", "of the search (default: 1)"),
                Argument("--jobs", read.jobs, "N", "seeds of a candidate at once (default: 1)"),
                Argument("--cluster", read.address, "ADDRESS", "on the nodes of this cluster"),
                Argument("--output", read.file, "DIR", "folder of the run"),
            )),
    Subcommand("fit", "cli.fit:fit", "find numbers of a scene that a log of it tells",
            "It says how well, and what the log does not tell. The same command goes on where it "
            "was interrupted.", (
                Argument("scene", read.file, "SCENE", "an MJCF or URDF file"),
                Argument("log", read.file, "LOG", ".npz, .csv or .mcap"),
                Argument("--sim", read.simulator, "NAME", "the simulator"),
                Argument("--profile", read.profiles, "NAME|FILE", "its settings (default: tuned)"),
                Argument("--unknown", read.words, "KIND:NAME,...", "what is sought: "
                         "friction:block, or with its range friction:block=0.1..1; may come "
                         "several times", action="append"),
                Argument("--noise", read.NOISE, "SD", "of what was measured, in m and rad "
                         "(default: told by the residuals)"),
                Argument("--budget", read.duration, "TIME", "default: 30min"),
                Argument("--output", read.file, "DIR", "folder of the run"),
            )),
    Subcommand("stats", "measure.suites:stats", "print what the suites' claims let pass"),
    Subcommand("replay", "repeatability.example:replay_file", "replay an episode that a failing "
            "test left in its run folder", "The file says what to simulate; how to start the "
            "simulator is this machine's own.", (
                Argument("path", read.file, "FILE", "examples/NAME.json in the run folder"),
                Argument("--gui", help="in the simulator's own window", action="store_true"),
                Argument("--python", read.file, "PATH", "interpreter of the simulator's worker"),
                Argument("--spec", str, "SPEC", "execnet specification of the simulator's worker"),
                Argument("--trust-robot", help="use the description files that FILE names, for a "
                         "robot that is not known here", action="store_true"),
            )),
    Subcommand("cluster head", "cluster.serving:head", "the scheduler, which knows all nodes; one "
            "of it", "", (
                Argument("--host", str, "HOST", "address to listen on (default: 127.0.0.1)"),
                Argument("--port", read.Number(0, 65535, whole=True), "PORT", "default: 8786"),
                Argument("--lost-after", read.Number(1, read.LONGEST), "SECONDS", "silence after "
                         "which a node counts as lost (default: 30)"),
                Argument("--tls", help="encrypted, by the certificates of Dask's configuration",
                         action="store_true"),
                Argument("--pages", help="serve Dask's pages, to whoever reaches this machine",
                         action="store_true"),
            )),
    Subcommand("cluster node", "cluster.serving:node", "a machine that carries repetitions out",
            "", (
                Argument("address", read.address, "ADDRESS", "of the head: tcp://head:8786, or "
                         "tls://head:8786"),
                Argument("--host", str, "HOST", "address to listen on (default: the one that faces "
                         "the head)"),
                Argument("--name", str, "NAME", "in records (default: the machine's)"),
                Argument("--slots", read.REPETITIONS, "N", "repetitions at once; with more than "
                         "one, records are contended (default: 1)"),
                Argument("--sim", read.simulators, "NAME,...", "simulators to offer (default: all "
                         "that are ready here)"),
            )),
    Subcommand("swing", "motion.swing:print_swing", "find a swing for the throw of a robot", "", (
                Argument("robot", read.robot, "NAME|FILE", "a name that simbench robots lists, or "
                         "a TOML file"),
                Argument("--landing", read.ANY_NUMBER, "X", "times the scene's scale [m] (default: "
                         "1.367)"),
            )),
)  # fmt: skip

GROUPS = {"cluster": "start the head of a cluster, or a node of it"}


class Parser(argparse.ArgumentParser):
    """A parser that complains in one sentence."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong with the arguments, and exit."""
        self.exit(BAD_INPUT, f"{self.prog}: {message}; {self.prog} --help says more\n")


def parser() -> Parser:
    """The parser of all commands."""
    top = Parser(
        prog="simbench",
        description="Compare robot simulators: everything besides the tests, which pytest runs.",
        epilog="simbench COMMAND --help says what a command takes.",
    )
    places = {"": top.add_subparsers(metavar="COMMAND", parser_class=Parser)}
    for command in COMMANDS:
        group, _, name = command.name.rpartition(" ")
        if group not in places:
            one = places[""].add_parser(group, help=GROUPS[group])
            places[group] = one.add_subparsers(required=True, metavar="COMMAND")
        about = f"{command.help[0].upper()}{command.help[1:]}. {command.more}".strip()
        one = places[group].add_parser(name, help=command.help, description=about)
        one.set_defaults(function=command.function)
        for argument in command.arguments:
            given = {key: value for key, value in argument._asdict().items() if value is not None}
            one.add_argument(given.pop("name"), **given)
        if command.verbose:
            one.add_argument("-v", "--verbose", action="store_true", help=command.verbose)
    return top


def main(arguments: Sequence[str] | None = None) -> int:
    """Do what a command line asks for; the exit code: 2 for one that cannot be."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    name = words[0] if words else ""
    top = parser()
    given = vars(top.parse_args(words))
    if not given:
        top.print_help(sys.stderr)
        return BAD_INPUT
    try:
        status = int(_function(given.pop("function"))(**given))
        sys.stdout.flush()
        return status
    except _complaints() as error:  # looked at when there is one
        return _complain(name, str(error), BAD_INPUT)
    except KeyboardInterrupt:
        return _complain(name, "interrupted; nothing that it read was changed", INTERRUPTED)
    except OSError as error:
        if error.errno not in (errno.EPIPE, errno.ENOSPC) or error.filename is not None:
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if error.errno == errno.EPIPE:  # of `simbench list | head`
            return 1
        return _complain(name, f"the output could not be written ({error.strerror})", 1)


def _function(place: str) -> Callable[..., Any]:
    module, _, name = place.partition(":")
    found: Callable[..., Any] = getattr(import_module(f"pytest_simbench.{module}"), name)
    return found


def _complaints() -> tuple[type[Exception], ...]:
    """The errors whose messages are for the user."""
    from pytest_simbench.client.errors import ExecutorError
    from pytest_simbench.data.measured import DataError
    from pytest_simbench.experiment.example import ExampleError
    from pytest_simbench.ground.errors import SimulatorError
    from pytest_simbench.motion.errors import RobotError

    return read.BadInput, SimulatorError, ExecutorError, DataError, ExampleError, RobotError


def _complain(command: str, sentence: str, status: int) -> int:
    from pytest_simbench.ground.text import for_terminal

    print(for_terminal(f"simbench {command}: {sentence}"), file=sys.stderr)
    return status
