"""Writes docs/options.md: every option, mark and fixture, from where the plugin has them.

python docs/make_options.py
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from pytest_simbench.cli.main import COMMANDS
from pytest_simbench.plugin import fixtures, repeatability
from pytest_simbench.plugin.hooks import MARKS
from pytest_simbench.plugin.old_options import OLD_OPTIONS
from pytest_simbench.plugin.options import OPTIONS, Option

PAGE = Path(__file__).with_name("options.md")

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

TEMPLATE = """\
# Options, marks and fixtures

The script `docs/make_options.py` writes this page. A test checks that it is up to date.

## Options

{options}

Another plugin or a conftest may have a short name, `--gui` for instance. Then the name is theirs.
The name under *sure* works in any case. The test run says so.

`pytest --help` leaves out the options with *rare*.

Each option has a twin in the ini file. Its name has underscores: `sim_jobs = 2`, `reps = 40`.
Options with *no ini* concern a single run and have no twin. The command line wins over the ini
file. The plugin checks all values before the run begins. A wrong value ends the run in one
sentence.

A comma separates several values (`--sim mujoco,pybullet`). A value of `--sim-python` or
`--sim-spec` may hold a comma. Repeat these options instead.

## What runs and exits

The command `simbench` does it. `simbench COMMAND --help` says what a command takes. For one release
the options of 0.1 still work. They call the command and name it.

{commands}

## Marks

{marks}

A mark takes several names: `@pytest.mark.only_sim("mujoco", "drake")`.

## Fixtures

{fixtures}

Another plugin may have a fixture of the same name. Then the name is theirs. A conftest gives ours
another name with an import:
`from pytest_simbench.plugin.fixtures import output_path as run_folder`.
Without pytest-benchmark (`-p no:benchmark`) all works but its rounds.
"""


def page() -> str:
    """The page as it should be."""
    return TEMPLATE.format(
        options=table(("option", "sure", "default", "meaning"), map(option_row, OPTIONS)),
        commands=table(("command", "meaning", "option of 0.1"), command_rows(), code=1),
        marks=table(("mark", "meaning"), (mark.split(": ", 1) for mark in MARKS), code=1),
        fixtures=table(("fixture", "lives for", "meaning"), fixture_rows()),
    )


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


def table(headings: Iterable[str], rows: Iterable[Iterable[str]], code: int = 0) -> str:
    """A Markdown table; the first `code` cells of each row are code."""
    lines = [list(headings)]
    lines.append(["---"] * len(lines[0]))
    for row in rows:
        cells = [" ".join(cell.split()).replace("|", "\\|") for cell in row]
        lines.append([f"`{cell}`" if i < code else cell for i, cell in enumerate(cells)])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


if __name__ == "__main__":
    PAGE.write_text(page(), "utf-8")
