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
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from difflib import unified_diff
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

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


def assert_approved_message(text: str) -> None:
    """The running test has such a message."""
    if not Running.test or sys.version_info[:2] != PYTHON:
        return
    file, _, function = Running.test.partition("[")[0].partition("::")
    for passing, told in PASSING:
        text = passing.sub(told, text)
    text = LONG.sub(_rounded, text)
    place = file.removeprefix("tests/").removesuffix(".py").replace("/", "-")
    assert_approved_line(f"messages/{place}", ascii(f"{function}: {text}")[1:-1])


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


def in_words(value: Any) -> str:
    """A result in words: numbers with six digits, dataclasses by their fields."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, float):
        return f"{value:.6g}" if abs(value) > 1e-9 else "0"
    if is_dataclass(value):
        of = {f.name: getattr(value, f.name) for f in fields(value)}
        return f"{type(value).__name__}{in_words(of)}"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{k}: {in_words(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(in_words, value)) + "]"
    return str(value)
