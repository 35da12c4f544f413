"""Hooks that sanitise what pytest itself prints of us: usage errors and failing tests.

A message may quote a record, a worker's log or a file's name. Standard library and pytest only.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Any

import pytest

from pytest_simbench.ground.text import for_terminal

LONGEST_LINE = 20_000
"""Characters of a line in a failing test's report: diffs of long values are wanted there."""


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_cmdline_main() -> Generator[None, Any, Any]:
    """Usage errors, from before the session until its end."""
    try:
        return (yield)
    except pytest.UsageError as error:
        error.args = tuple(for_terminal(arg) if isinstance(arg, str) else arg for arg in error.args)
        raise


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, Any, Any]:
    """The report of a test that uses a simulator."""
    report = yield
    if "sim_case" in getattr(item, "fixturenames", ()):
        report.longrepr = _sanitised(report.longrepr)
    return report


@pytest.hookimpl(tryfirst=True)
def pytest_warning_recorded(warning_message: Any) -> None:
    """Warnings of ours, of a claim that is undecided for instance."""
    warning = warning_message.message
    if type(warning).__module__.partition(".")[0] == __name__.partition(".")[0]:
        warning.args = tuple(for_terminal(str(arg)) for arg in warning.args)


def _sanitised(shown: Any) -> Any:
    """A failure's or a skip's representation, whose lines are all printable."""
    if isinstance(shown, str):
        return for_terminal(shown, LONGEST_LINE)
    if isinstance(shown, tuple):  # of a skip: path, line, reason
        return tuple(_sanitised(part) for part in shown)
    chain = getattr(shown, "chain", None) or [
        (getattr(shown, "reprtraceback", None), getattr(shown, "reprcrash", None), None)
    ]
    for traceback, crash, _ in chain:
        for entry in getattr(traceback, "reprentries", ()):
            _clean(entry)
            _clean(getattr(entry, "reprlocals", None))
            if getattr(entry, "reprfileloc", None) is not None:
                entry.reprfileloc.message = for_terminal(entry.reprfileloc.message)
        if crash is not None:
            crash.message = for_terminal(crash.message, LONGEST_LINE)
    return shown


def _clean(lines: Any) -> None:
    if lines is not None:
        lines.lines = [for_terminal(line, LONGEST_LINE) for line in lines.lines]
