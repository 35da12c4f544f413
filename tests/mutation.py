"""Would the tests notice a fault? Plants faults one at a time and asks the tests that reach each
(docs/mutation.md).

    pip install mutmut pytest-cov
    python tests/mutation.py learn -n 2 tests              # which test reaches which line: 1 hour
    python tests/mutation.py ask --seed 7 --count 150      # drawn at random; goes on after Ctrl-C
    python tests/mutation.py ask --seed 7 --count 60 --under pytest_simbench/report

Type it in a clone with an environment of its own: the faults are written into its files, where
workers and other processes find them. One process has collected all tests. It forks for each fault,
and the child changes the code of the function. Whom nobody noticed is asked again by a new pytest:
what runs while modules are imported has run before.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from difflib import unified_diff
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any, NamedTuple

import pytest
from _pytest.runner import runtestprotocol

ROOT = Path(__file__).resolve().parents[1]
KEPT = ROOT / ".mutation"
"""What is learnt, and the answers."""

TOPS = ("pytest_simbench", "sims")

MOST = 30.0
"""The tests that a fault is shown take so long together [s]: the shortest. One of the fault's room
counts as `AT_HOME` of its length."""

AT_HOME = 0.3

SLOWER, GRACE = 3.0, 15.0
"""A fault that makes its tests take so many times longer, and so many seconds more, is noticed."""

PROCESS = "COVERAGE_PROCESS_START"
CONTEXT = "SIMBENCH_TEST"
CONFIG = f"""[run]
include = {", ".join(f"{ROOT}/{top}/*" for top in TOPS)}
data_file = {KEPT}/coverage
parallel = true
patch = _exit
"""


class Fault(NamedTuple):
    """A changed place: file below `ROOT`, number, line, the change, and the whole file with it."""

    file: str
    place: int
    line: int
    change: str
    source: str


def places(file: str) -> tuple[Any, list[Any]]:
    """The parsed file, and what mutmut would change in its functions."""
    from libcst import FunctionDef
    from mutmut.mutation.file_mutation import create_mutations

    module, found, *_ = create_mutations(file, (ROOT / file).read_text())
    return module, [m for m in found if isinstance(m.contained_by_top_level_function, FunctionDef)]


def drawn(seed: int, count: int, under: str) -> Iterator[Fault]:
    """So many faults of the files below a path, each place as likely as any other."""
    tops = [under] if under else TOPS
    files = sorted({str(p.relative_to(ROOT)) for top in tops for p in (ROOT / top).rglob("*.py")})
    every = [(file, place) for file in files for place in range(len(places(file)[1]))]
    for file, place in random.Random(seed).sample(every, min(count, len(every))):
        module, found = places(file)
        source = module.deep_replace(found[place].original_node, found[place].mutated_node).code
        _, _, where, *change = unified_diff(module.code.splitlines(), source.splitlines(), n=0)
        line = int(where.split()[1].strip("-").partition(",")[0])
        yield Fault(file, place, line, "\n".join(change), source)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """While `learn` runs: processes that a test starts measure coverage in its name."""
    os.environ.update({CONTEXT: item.nodeid, PROCESS: str(KEPT / "process.ini")})
    try:
        return (yield)
    finally:
        del os.environ[PROCESS]


class Times:
    """A plugin: how long each test took [s], and which failed."""

    def __init__(self) -> None:
        self.seconds: Counter[str] = Counter()
        self.failed: set[str] = set()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.seconds[plain(report.nodeid)] += int(1000 * report.duration) / 1000
        if report.failed:
            self.failed.add(plain(report.nodeid))


def plain(test: str) -> str:
    """A test's id, without the group of pytest-xdist."""
    return test.partition("@")[0]


def learn(arguments: Sequence[str], side_by_side: str) -> None:
    """Run the tests once: which reaches which line, how long each takes. Who fails is not asked."""
    KEPT.mkdir(exist_ok=True)
    for old in KEPT.glob("coverage*"):
        old.unlink()
    (KEPT / "session.ini").write_text(CONFIG)
    (KEPT / "process.ini").write_text(f"{CONFIG}context = ${{{CONTEXT}}}|\n")
    times = Times()
    given = ["-n", side_by_side, "-p", "tests.mutation", "-p", "no:cacheprovider", "--cov"]
    covered = ["--cov-context=test", "--cov-report=", f"--cov-config={KEPT / 'session.ini'}"]
    pytest.main([*arguments, *given, *covered], plugins=[times])
    passed = {test: s for test, s in times.seconds.items() if test not in times.failed}
    kept = {"arguments": arguments, "seconds": passed, "reach": reached(list(passed))}
    (KEPT / "learnt.json").write_text(json.dumps(kept))


def reached(tests: Sequence[str]) -> dict[str, dict[int, list[int]]]:
    """Of each line of each file, the numbers of the tests that reach it."""
    from coverage.exceptions import DataError
    from coverage.sqldata import CoverageData

    numbers = {test: number for number, test in enumerate(tests)}
    reach: dict[str, dict[int, set[int]]] = defaultdict(lambda: defaultdict(set))
    for path in KEPT.glob("coverage*"):
        data = CoverageData(str(path))
        try:
            data.read()
        except DataError:  # of a process that was killed
            continue
        for file in data.measured_files():
            for line, contexts in data.contexts_by_lineno(file).items():
                known = {plain(context.partition("|")[0]) for context in contexts}
                reach[str(Path(file).relative_to(ROOT))][line] |= {
                    numbers[test] for test in known & numbers.keys()
                }
    return {file: {n: sorted(t) for n, t in lines.items()} for file, lines in reach.items()}


class Asking:
    """A plugin: in place of all tests, those that reach each fault."""

    def __init__(self, faults: Sequence[Fault], answers: Path, learnt: dict[str, Any]) -> None:
        self.faults = faults
        self.answers = answers
        self.reach: dict[str, dict[str, list[int]]] = learnt["reach"]
        self.seconds: dict[str, float] = learnt["seconds"]

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        items = {plain(item.nodeid): item for item in session.items}
        known: dict[tuple[str, str, int], list[FunctionType]] = defaultdict(list)
        for thing in gc.get_objects():
            if type(thing) is FunctionType:
                known[names(thing.__code__)].append(thing)
        gc.freeze()  # children would copy what a collection touches
        for fault in self.faults:
            tests = self.tests(fault, items)
            with planted(fault) as (old, new):
                seen = self.asked(session, known[names(old)], new, [items[test] for test in tests])
                seen = seen or self.asked_anew(tests)
            answer = {**fault._asdict(), "source": None, "asked": len(tests), "noticed": seen}
            with self.answers.open("a") as file:
                file.write(json.dumps(answer) + "\n")
            told = seen or f"NOT NOTICED\n{fault.change}"
            print(f"\n{fault.file}:{fault.line}, {len(tests)} tests: {told}")
        return True

    def tests(self, fault: Fault, items: dict[str, Any]) -> list[str]:
        """The tests to ask: those that reach the line, or the statement that it is in, and those of
        the file, which may know what ran while it was imported."""
        every, lines = list(self.seconds), self.reach.get(fault.file, {})
        there = next((lines[str(n)] for n in range(fault.line, 0, -1) if str(n) in lines), [])
        top, *rooms, name = fault.file.removesuffix(".py").split("/")
        home, name = ("sims", rooms[0]) if top == "sims" else ("/".join(rooms), name)
        own = [n for n, t in enumerate(every) if t.startswith(f"tests/{home}/test_{name}")]

        def length(test: str) -> float:
            return self.seconds[test] * (AT_HOME if test.startswith(f"tests/{home}/") else 1.0)

        chosen, total = list[str](), 0.0
        for test in sorted({every[n] for n in [*there, *own] if every[n] in items}, key=length):
            total += self.seconds[test]
            if chosen and total > MOST:
                break
            chosen.append(test)
        return chosen

    def limit(self, tests: Sequence[str]) -> float:
        return GRACE + SLOWER * sum(self.seconds[test] for test in tests)

    def asked(
        self, session: pytest.Session, changed: Sequence[FunctionType], code: CodeType,
        items: Sequence[Any],
    ) -> str:  # fmt: skip
        """Who noticed: a test, or that the child did not come to an end; empty if nobody did."""
        told, tell = os.pipe()
        child = os.fork()
        if not child:
            os.setpgid(0, 0)
            found = ""
            try:
                for function in changed:
                    function.__code__ = code
                for item, following in zip(items, [*items[1:], None], strict=False):
                    if any(r.failed for r in runtestprotocol(item, log=False, nextitem=following)):
                        found = item.nodeid
                        session._setupstate.teardown_exact(None)
                        break
            except BaseException as error:  # also of what ends the child's pytest
                found = found or f"raised {type(error).__name__}"
            finally:
                os.write(tell, found.encode())
                os._exit(0)
        os.close(tell)
        end = time.monotonic() + self.limit([plain(item.nodeid) for item in items])
        while not (status := os.waitpid(child, os.WNOHANG))[0]:
            if time.monotonic() > end:
                os.killpg(child, signal.SIGKILL)
                os.waitpid(child, 0)
                return "took too long"
            time.sleep(0.02)
        with os.fdopen(told, "rb") as pipe:
            return pipe.read().decode() if not status[1] else "died"

    def asked_anew(self, tests: Sequence[str]) -> str:
        """The same of a new pytest."""
        if not tests:
            return ""
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
        try:
            ended = subprocess.run(command, capture_output=True, timeout=self.limit(tests))
        except subprocess.TimeoutExpired:
            return "took too long"
        return "a new pytest" if ended.returncode else ""


def names(code: CodeType) -> tuple[str, str, int]:
    """What a function is known by."""
    return code.co_filename, code.co_qualname, code.co_firstlineno


def functions(code: CodeType) -> Iterator[CodeType]:
    """The code of a module's functions and methods, not of what they hold."""
    for part in code.co_consts:
        if isinstance(part, CodeType):
            if part.co_flags & 2:  # CO_NEWLOCALS: a function; a class has not
                yield part
            else:
                yield from functions(part)


@contextmanager
def planted(fault: Fault) -> Iterator[tuple[CodeType, CodeType]]:
    """The fault stands in its file; gives the code of the function, old and new: that of the module
    where it is in a default argument."""
    path = ROOT / fault.file
    before, status = path.read_bytes(), path.stat()
    both = [compile(text, str(path), "exec") for text in (before, fault.source)]
    pairs = zip(*map(functions, both), strict=False)
    changed = next((pair for pair in pairs if pair[0] != pair[1]), (both[0], both[1]))
    path.write_text(fault.source)
    os.utime(path, (0, time.time() + 10))  # compiled files are told apart by seconds
    try:
        yield changed
    finally:
        path.write_bytes(before)
        os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


def ask(seed: int, count: int, under: str) -> None:
    """Plant faults; one that was asked before is not asked again."""
    if not (KEPT / "learnt.json").exists():
        sys.exit("nothing is learnt yet: python tests/mutation.py learn -n 2 tests")
    learnt = json.loads((KEPT / "learnt.json").read_text())
    answers = KEPT / f"{seed}{under.replace('/', '-')}.jsonl"
    answers.touch()
    done = {(d["file"], d["place"]) for d in map(json.loads, answers.read_text().splitlines())}
    faults = [f for f in drawn(seed, count, under) if (f.file, f.place) not in done]
    given = ["-q", "-s", "-p", "no:xdist", "-p", "no:cacheprovider"]
    pytest.main([*learnt["arguments"], *given], plugins=[Asking(faults, answers, learnt)])
    found = [json.loads(line)["noticed"] for line in answers.read_text().splitlines()]
    print(f"{sum(map(bool, found))} of {len(found)} faults were noticed")


def main() -> None:
    raw = argparse.RawTextHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    commands = parser.add_subparsers(dest="command", required=True)
    told = commands.add_parser("learn", help="run the tests once")
    told.add_argument("-n", default="0", help="of pytest-xdist")
    told.add_argument("tests", nargs=argparse.REMAINDER, help="what pytest is given")
    told = commands.add_parser("ask", help="plant faults")
    told.add_argument("--seed", type=int, required=True)
    told.add_argument("--count", type=int, default=150)
    told.add_argument("--under", default="", help="a path")
    options = parser.parse_args()
    os.chdir(ROOT)
    sys.path.insert(0, str(ROOT))
    if options.command == "learn":
        learn(options.tests, options.n)
    else:
        ask(options.seed, options.count, options.under)


if __name__ == "__main__":
    main()
