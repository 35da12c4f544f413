"""Tables of every option, command, mark and fixture, and of what the kit is known to find."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from tables import DOCS, NAMES, table

from pytest_simbench.cli.main import COMMANDS
from pytest_simbench.plugin import fixtures, repeatability
from pytest_simbench.plugin.hooks import MARKS
from pytest_simbench.plugin.old_options import OLD_OPTIONS
from pytest_simbench.plugin.options import OPTIONS, Option
from pytest_simbench.testing.kit import read_expected_failures

FAILURES = DOCS.parent / "tests" / "sims" / "expected_failures.txt"

INTERNAL = (
    "sim_case",
    "simbench_case",
    "simbench_case_here",
    "simbench_handle",
    "simbench_robot",
    "benchmark_rounds",
    "no_rounds",
)
"""Fixtures that tests do not ask for by name."""


def options() -> str:
    return words(("option", "sure", "default", "meaning"), map(option_row, OPTIONS))


def commands() -> str:
    return words(("command", "meaning", "option of 0.1"), command_rows(), code=1)


def marks() -> str:
    return words(("mark", "meaning"), (mark.split(": ", 1) for mark in MARKS), code=1)


def fixture_table() -> str:
    return words(("fixture", "lives for", "meaning"), fixture_rows())


def known_failures() -> str:
    """Checks of the kit that shipped engines fail, sorted by law and engine."""
    rows = []
    for test, reason in read_expected_failures(FAILURES).items():
        name, _, *robot, law = test.split("-")
        engine = ", ".join([NAMES[name], *("other robots" if r == "*" else r for r in robot)])
        rows.append((law, engine, reason))
    return words(("law", "engine", "what was found"), sorted(rows), code=1)


def option_row(option: Option) -> tuple[str, str, str, str]:
    """The cells of an option."""
    typed = f"{option.flag} {option.metavar}".strip()
    told = ",".join(option.default) if isinstance(option.default, tuple) else option.default
    default = "" if told in (None, False, [], {}) else f"`{told}`"
    notes = [note for note, holds in (("rare", option.rare), ("no ini", not option.ini)) if holds]
    meaning = " ".join([option.help, *(f"(*{note}*)" for note in notes)])
    return f"`{typed}`", f"`{option.long}`" if option.long else "", default, meaning


def command_rows() -> Iterable[tuple[str, str, str]]:
    """The cells of each command."""
    for name, text in ((c.name, c.help) for c in COMMANDS):
        old = [option.flag for option in OLD_OPTIONS if option.command == name]
        yield f"simbench {name}", text, ", ".join(f"`{flag}`" for flag in old)


def fixture_rows() -> Iterable[tuple[str, str, str]]:
    """The cells of each fixture."""
    for name, thing in sorted({**vars(repeatability), **vars(fixtures)}.items()):
        marker = getattr(thing, "_fixture_function_marker", None)
        if marker is not None and name not in INTERNAL:
            lives = "a test" if marker.scope == "function" else f"the {marker.scope}"
            yield f"`{name}`", lives, (thing.__doc__ or "").split("\n\n")[0]


def words(headings: Sequence[str], rows: Iterable[Iterable[str]], code: int = 0) -> str:
    """A table of words; the first `code` cells of each row are code."""
    cells = ([" ".join(cell.split()).replace("|", "\\|") for cell in row] for row in rows)
    told = ([f"`{c}`" if k < code else c for k, c in enumerate(row)] for row in cells)
    return table(headings, told, len(headings))
