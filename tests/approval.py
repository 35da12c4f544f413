"""Texts word for word: what somebody read and approved lies in `approved/`.

Who changes one on purpose writes them anew, and reads what changed:

    rm -r tests/approved/messages
    SIMBENCH_APPROVE=1 pytest tests -m "not engine" -n 2 --dist loadfile; git diff tests/approved
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import fields, is_dataclass
from difflib import unified_diff
from functools import cache, partial, wraps
from inspect import isclass, isfunction, isgeneratorfunction
from itertools import islice
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.record import Record

APPROVED = Path(__file__).parent / "approved"

HOW = "if it is meant, write it with SIMBENCH_APPROVE=1 (tests/approval.py)"

LONG = re.compile(r"\d+\.\d{7,}(e-?\d+)?")
"""Numbers whose last digits another processor may round otherwise."""

PASSING = (
    (re.compile(r"(\n--- last lines|; its last words:).*", re.DOTALL), ""),
    (re.compile(r"(?<![\w.])/[\w./+-]*/(test_\w*\d\b)?"), "DIR/"),
    (re.compile(r"(?<=the folder )DIR/\S+(?= of the scene)"), "DIR/"),
    (re.compile(r"(?<=the releases of nosuch )\([^)]*\)"), "HOST"),  # those of this machine
    (re.compile(r"\b(127\.0\.0\.1|localhost):\d+"), "HOST"),
    (re.compile(r"\d{4}-\d\d-\d\d_[\d-]+-[0-9a-f]{8}|0x[0-9a-f]+|[0-9a-f]{24,}"), "#"),
    (re.compile(r"\b\d+(\.\d+)? s\b|(?<=process )\d+|\d(\.\d+)?e-1\d"), "#"),
)
"""What is another one each time: logs, folders, ports, names of runs, addresses, digests, seconds,
numbers of processes, and what rounding leaves."""

LONGEST, MANY = 2000, 24
"""Characters of a result that are held; of an array of more numbers its shape, ends and moments."""

DIGEST = re.compile(r"\b[0-9a-f]{16}\b|(?<=simbench-)\d+-[0-9a-f]+")
EMPTY = {"None", "False", "[]", "{}", ""}
"""What is not told of a dataclass."""

PYTHON = (3, 11)
"""Whose words stand in messages; other releases word theirs differently."""


def approving() -> bool:
    return bool(os.environ.get("SIMBENCH_APPROVE"))


def _rounded(number: re.Match[str]) -> str:
    return f"{float(number[0]):.6g}"


def assert_approved(name: str, text: str) -> None:
    """The text is that of the file, but for the last digits of long numbers."""
    found = LONG.sub(_rounded, text)
    file = APPROVED / f"{name}.txt"
    if approving():
        file.write_text(found)
    approved = file.read_text()
    changed = islice(unified_diff(approved.splitlines(), found.splitlines(), n=1, lineterm=""), 40)
    assert found == approved, "\n".join([f"{file} holds another text; {HOW}", *changed])


def assert_approved_line(name: str, line: str) -> None:
    """The line is one of those of the file, which tests share."""
    if approving():
        file = APPROVED / f"{name}.txt"
        file.parent.mkdir(exist_ok=True)
        kept = file.read_text().splitlines() if file.exists() else []
        file.write_text("\n".join([*sorted({*kept, line}), ""]))
        _lines.cache_clear()
    assert line in _lines(name), f"tests/approved/{name}.txt does not hold it: {line}; {HOW}"


@cache
def _lines(name: str) -> frozenset[str]:
    file = APPROVED / f"{name}.txt"
    return frozenset(file.read_text().splitlines()) if file.exists() else frozenset()


class Running:
    """The test whose messages are held; none of one that needs an engine or draws at random."""

    test = ""
    results, digits = 0, 6
    """Of how many calls more the result is held, and how many digits of its numbers."""


def assert_approved_message(text: str, kind: str = "messages") -> None:
    """The running test has such a message, or such a result."""
    if not Running.test or sys.version_info[:2] != PYTHON:
        return
    file, _, function = Running.test.partition("[")[0].partition("::")
    for passing, told in PASSING:
        text = passing.sub(told, text)
    text = LONG.sub(_rounded, text)
    place = file.removeprefix("tests/").removesuffix(".py").replace("/", "-")
    assert_approved_line(f"{kind}/{place}", ascii(f"{function}: {text}")[1:-1])


def watched(raises: Callable[..., Any]) -> Callable[..., Any]:
    """`pytest.raises` that holds the whole message, of each error of ours and where it is asked for
    a part of it."""

    @contextmanager
    def told(context: Any, *, asked: bool) -> Iterator[Any]:
        with context as info:
            yield info
        if asked or type(info.value).__module__.startswith("pytest_simbench"):
            assert_approved_message(str(info.value))

    return lambda *args, **named: told(raises(*args, **named), asked="match" in named)


def in_words(value: Any, properties: bool = True) -> str:
    """A result in words: numbers of some digits, dataclasses with what differs from their defaults
    and with their properties, but not those of what a property gives."""
    tell = partial(in_words, properties=properties)
    value = value.item() if isinstance(value, np.generic) else value
    if isinstance(value, float):
        return f"{value:.{Running.digits}g}" if not abs(value) < 1e-9 else "0"
    if isinstance(value, Record | Metric):
        return f"{value.test}#{value.repetition}" if isinstance(value, Record) else value.name
    if isinstance(value, np.ndarray):
        if value.size <= MANY:
            return tell(value.tolist())
        ends = tell([value.flat[0], value.flat[-1], value.mean(), value.std()])
        return f"{value.dtype.kind} {tell(value.shape)} {ends}"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{tell(k)}: {tell(v)}" for k, v in value.items()) + "}"
    if isinstance(value, set | frozenset):
        return "{" + ", ".join(sorted(map(tell, value))) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(tell, value)) + "]"
    if is_dataclass(value):
        kind = type(value)
        parts = ((f.name, tell(getattr(value, f.name)), tell(f.default)) for f in fields(value))
        given = {name: part for name, part, default in parts if part not in {*EMPTY, default}}
        for name in dir(kind) if properties else ():
            if isinstance(getattr(kind, name), property) and name[0] != "_":
                with suppress(Exception), np.errstate(all="ignore"):  # it has none
                    if (part := in_words(getattr(value, name), properties=False)) not in EMPTY:
                        given[name] = part
        return f"{kind.__name__}({', '.join(f'{n}={t}' for n, t in given.items())})"
    plain = isinstance(value, str | int | Path) or value is None
    return " ".join(str(value).split()) if plain else type(value).__name__


def watched_results(module: ModuleType, room: str) -> Iterator[tuple[Any, str, Any]]:
    """Where functions and public methods of the room stand that the module of tests has, and what
    calls them and holds what they return."""

    def watched(function: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(function)
        def call(*args: Any, **named: Any) -> Any:
            left, Running.results = Running.results, 0  # not what it calls itself
            asked = sys._getframe(1).f_globals.get("__name__", "").startswith("tests.")
            try:
                result = function(*args, **named)
                result = [*result] if isgeneratorfunction(function) else result
            finally:
                Running.results = left
            if result is not None and left and asked:
                Running.results -= 1
                line = f"{function.__qualname__} -> {in_words(result)[:LONGEST]}"
                assert_approved_message(DIGEST.sub("#", line), "results")
            return iter(result) if isgeneratorfunction(function) else result

        return call

    home = f"pytest_simbench.{room}."
    ours = [v for v in vars(module).items() if getattr(v[1], "__module__", "").startswith(home)]
    places: list[tuple[Any, str, Any]] = [(module, *item) for item in ours]
    places += [(kind, *item) for _, kind in ours if isclass(kind) for item in vars(kind).items()]
    for place, name, value in places:
        if isfunction(value) and not name.startswith(("_", "assert_")):
            yield place, name, watched(value)
