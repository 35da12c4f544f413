"""Texts word for word: what somebody read and approved lies in `approved/`.

Who changes one on purpose writes them anew, and reads what changed:

    rm -r tests/approved/messages
    SIMBENCH_APPROVE=1 pytest tests -m "not engine" -n 2 --dist loadfile; git diff tests/approved
"""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

APPROVED = Path(__file__).parent / "approved"

LONG = re.compile(r"\d+\.\d{7,}(e-?\d+)?")
"""Numbers whose last digits another processor may round otherwise."""

PASSING = (
    (re.compile(rf"{re.escape(tempfile.gettempdir())}/[\w./+-]*/"), "TMP/"),
    (re.compile(re.escape(str(Path(__file__).parents[1]))), "HERE"),
    (re.compile(r"\b(127\.0\.0\.1|localhost):\d+"), "HOST"),
    (re.compile(r"0x[0-9a-f]+|\b\d+(\.\d+)? s\b|(?<=process )\d+"), "#"),
)
"""What is another one each time: folders, ports, addresses, seconds, numbers of processes."""


def approving() -> bool:
    return bool(os.environ.get("SIMBENCH_APPROVE"))


def assert_approved(name: str, text: str) -> None:
    """The text is that of the file, but for the last digits of long numbers."""
    found = LONG.sub(lambda number: f"{float(number[0]):.6g}", text)
    file = APPROVED / f"{name}.txt"
    if approving():
        file.write_text(found)
    assert found == file.read_text()


def assert_approved_line(name: str, line: str) -> None:
    """The line is one of those of the file, which tests share."""
    if approving():
        file = APPROVED / f"{name}.txt"
        file.parent.mkdir(exist_ok=True)
        kept = file.read_text().splitlines() if file.exists() else []
        file.write_text("\n".join([*sorted({*kept, line}), ""]))
        _lines.cache_clear()
    assert line in _lines(name)


@cache
def _lines(name: str) -> frozenset[str]:
    file = APPROVED / f"{name}.txt"
    return frozenset(file.read_text().splitlines()) if file.exists() else frozenset()


def assert_approved_message(text: str) -> None:
    """The running test has such a message."""
    file, _, test = os.environ["PYTEST_CURRENT_TEST"].rpartition(" ")[0].partition("::")
    for passing, told in PASSING:
        text = passing.sub(told, text)
    place = file.removeprefix("tests/").removesuffix(".py").replace("/", "-")
    assert_approved_line(f"messages/{place}", ascii(f"{test}: {text}")[1:-1])


def watched(raises: Callable[..., Any]) -> Callable[..., Any]:
    """`pytest.raises` that holds the whole message of each error of ours."""

    @contextmanager
    def told(context: Any) -> Iterator[Any]:
        with context as info:
            yield info
        if type(info.value).__module__.startswith("pytest_simbench"):
            assert_approved_message(str(info.value))

    return lambda *args, **named: told(raises(*args, **named))
