"""The command `simbench`: its arguments, and what is said of wrong ones.

What a command needs is imported when it runs: `simbench --help` answers at once.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from itertools import chain
from pathlib import Path
from typing import Any, NoReturn

from pytest_simbench.cli import values as read

BAD_INPUT = 2
"""Exit code, as argparse has it."""

INTERRUPTED = 130
"""Exit code, as shells have it."""

ELSEWHERE = {
    "stats": ("measure.__main__", "print what the suites' claims let pass, as a table"),
    "replay": ("repeatability.__main__", "replay an episode that a failing test left in its run"),
    "cluster": ("cluster.__main__", "start the head of a cluster, or a node of it"),
    "swing": ("robot.swing", "find a swing for the throw of a robot"),
}
"""Commands with arguments of their own, and the modules whose `main` reads them."""


class Parser(argparse.ArgumentParser):
    """A parser that complains in one sentence."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong with the arguments, and exit."""
        self.exit(BAD_INPUT, f"{self.prog}: {message}; {self.prog} --help says more\n")


def parser() -> Parser:
    """All commands and their arguments."""
    top = Parser(
        prog="simbench",
        description="Compare robot simulators: everything besides the tests, which pytest runs.",
        epilog="simbench COMMAND --help says what a command takes.",
    )
    commands = top.add_subparsers(metavar="COMMAND", parser_class=Parser)

    def add(name: str, run: Callable[[argparse.Namespace], int], text: str, more: str = "") -> Any:
        description = f"{text[0].upper()}{text[1:]}. {more}".strip()
        found = commands.add_parser(name, help=text, description=description)
        found.set_defaults(run=run, prog=found.prog)
        return found

    one = add("list", _list, "list the simulators, which are ready here, and how to get the others")
    one.add_argument("names", nargs="*", type=read.simulators, metavar="NAME",
                     help="say of this one what it is, where it is, and how to get it; "
                     "NAME==VERSION is a release")  # fmt: skip
    one.add_argument("-v", "--verbose", action="store_true",
                     help="what each can do, and where it deviates from a scene")  # fmt: skip
    one.add_argument("--cluster", type=read.address, metavar="ADDRESS",
                     help="ask the nodes of this cluster instead of this machine")  # fmt: skip

    one = add("robots", _robots, "list the robots, and check robot files")
    one.add_argument("names", nargs="*", type=read.robot, metavar="NAME|FILE",
                     help="say it of this one alone")  # fmt: skip

    one = add("install", _install, "make the environment of a simulator that needs one of its own",
              "It needs no other Python packages than those that it finds there.")  # fmt: skip
    one.add_argument("names", nargs="+", type=read.words, metavar="NAME",
                     help="a simulator, or a release: NAME==VERSION")  # fmt: skip

    one = add("uninstall", _uninstall, "remove such environments")
    one.add_argument("names", nargs="+", type=read.words, metavar="NAME",
                     help="as simbench environments lists it")  # fmt: skip

    add("environments", _environments, "list the environments that are there, with their sizes")

    one = add("download", _download, "bring a measured data set from its public source")
    one.add_argument("names", nargs="+", type=read.words, metavar="NAME", help="of a data set")
    one.add_argument("--data", type=read.file, metavar="DIR",
                     help="folder to bring it to (default: $SIMBENCH_DATA, else a cache of the "
                     "user's)")  # fmt: skip

    one = add("merge", _merge, "join runs with different seeds, made on several machines, into one")
    _of_runs(one, "folder of the whole (default: .simbench/TIME-merged)")

    one = add("report", _report, "print the tables and write the report of runs again",
              "Their folders are enough. Several are merged first.")  # fmt: skip
    _of_runs(one, "folder to write to (default: that of a single run)")

    one = add("bisect", _bisect, "find the release in which a metric becomes worse",
              "It runs the tests on releases between a good and a bad one.")  # fmt: skip
    one.add_argument("span", type=_kept(read.span), metavar="NAME:GOOD..BAD",
                     help="a simulator and two of its releases")  # fmt: skip
    one.add_argument("metric", type=read.metric, metavar="METRIC", help="that is worse in BAD")
    one.add_argument("arguments", nargs=argparse.REMAINDER, metavar="...",
                     help="tests and options of pytest")  # fmt: skip

    for name, (_, text) in ELSEWHERE.items():
        commands.add_parser(name, help=text, add_help=False)
    return top


def described() -> list[tuple[str, str]]:
    """Each command and what it does, for the page of options."""
    (commands,) = (a for a in parser()._actions if isinstance(a, argparse._SubParsersAction))
    return [(action.dest, action.help or "") for action in commands._choices_actions]


def _kept(type_: Callable[[str], Any]) -> Callable[[str], str]:
    """A check by a type that leaves the text as it is."""

    def check(text: str) -> str:
        type_(text)
        return text

    return check


def _of_runs(one: argparse.ArgumentParser, output: str) -> None:
    one.add_argument("runs", nargs="+", type=read.file, metavar="RUN", help="folder of a run")
    one.add_argument("--output", type=read.file, metavar="DIR", help=output)
    one.add_argument("--badge", type=read.file, metavar="FILE",
                     help="write the result as JSON for a badge of shields.io")  # fmt: skip
    one.add_argument("--record", choices=["mcap"], metavar="mcap",
                     help="write each repetition's motion as a rosbag2 folder")  # fmt: skip
    one.add_argument("-v", "--verbose", action="store_true", help="print whole tables")


def main(arguments: Sequence[str] | None = None) -> int:
    """Do what a command line asks for; the exit code: 2 for one that cannot be."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words and words[0] in ELSEWHERE:
        module = import_module(f"pytest_simbench.{ELSEWHERE[words[0]][0]}")
        return int(module.main(words[1:]) or 0)
    top = parser()
    given = top.parse_args(words)
    if "run" not in given:
        top.print_help(sys.stderr)
        return BAD_INPUT
    try:
        return int(given.run(given))
    except _complaints() as error:  # looked at when there is one
        return _complain(given.prog, str(error), BAD_INPUT)
    except KeyboardInterrupt:
        return _complain(given.prog, "interrupted; nothing that it read was changed", INTERRUPTED)
    except BrokenPipeError:  # of `simbench list | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


def _complaints() -> tuple[type[Exception], ...]:
    """The errors whose messages are for the user."""
    from pytest_simbench.data.errors import DataError
    from pytest_simbench.experiment.executor import ExecutorError
    from pytest_simbench.simulator.errors import SimulatorError

    return read.BadInput, SimulatorError, ExecutorError, DataError


def _complain(prog: str, sentence: str, status: int) -> int:
    from pytest_simbench.ground.text import for_terminal

    print(for_terminal(f"{prog}: {sentence}"), file=sys.stderr)
    return status


def _list(given: argparse.Namespace) -> int:
    from pytest_simbench.cli.simulators import list_simulators

    return list_simulators(list(chain(*given.names)), given.verbose, given.cluster)


def _robots(given: argparse.Namespace) -> int:
    from pytest_simbench.cli.robots import list_robots

    return list_robots(given.names)


def _install(given: argparse.Namespace) -> int:
    from pytest_simbench.cli.environments import install

    return install(list(chain(*given.names)))


def _uninstall(given: argparse.Namespace) -> int:
    from pytest_simbench.cli.environments import uninstall

    return uninstall(list(chain(*given.names)))


def _environments(given: argparse.Namespace) -> int:
    from pytest_simbench.cli.environments import list_environments

    return list_environments()


def _download(given: argparse.Namespace) -> int:
    from pytest_simbench.data.download import download
    from pytest_simbench.data.sets import data_set, default_folder
    from pytest_simbench.ground.text import for_terminal

    folder = Path(given.data) if given.data else default_folder()
    for wanted in [data_set(name) for name in chain(*given.names)]:
        download(wanted, folder, lambda text: print(for_terminal(text)))
    return 0


def _merge(given: argparse.Namespace) -> int:
    from pytest_simbench.cli.runs import Wanted, merge_runs

    return merge_runs(given.runs, Wanted.of(given))


def _report(given: argparse.Namespace) -> int:
    from pytest_simbench.cli.runs import Wanted, report_runs

    return report_runs(given.runs, Wanted.of(given))


def _bisect(given: argparse.Namespace) -> int:
    import pytest

    words = [*given.arguments, "--sim-bisect", given.span, given.metric]
    return int(pytest.main(words, plugins=[sys.modules[__name__]]))
