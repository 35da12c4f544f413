"""The account of what a reader carried of somebody's file, and what not."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pytest_simbench.ground.text import for_markdown
from pytest_simbench.records import lines
from pytest_simbench.records.paths import write_whole
from pytest_simbench.scene.checks import Wire

CARRIED, APPROXIMATED, NOT_CARRIED = STATES = ("carried", "approximated", "not carried")
"""The scene holds it as the file has it; nearly so; not at all."""

LINES, PAGE = "carried.jsonl", "carried.md"
"""Of a run folder: the accounts of the files that were read."""

MOST_NAMED = 3
"""Elements that a line names, and quantities that the terminal names."""


@dataclass(frozen=True)
class Carried(Wire):
    """What became of one quantity of a file.

    Attributes:
        quantity: in the words of the file.
        state: one of `STATES`.
        reason: how it is carried or approximated, and by how much; or why it is not, and what that
            may change.
        where: names of the elements, shortened when they are many; empty: of the whole file.

    Raises:
        ValueError: there is no such state.
    """

    quantity: str
    state: str
    reason: str
    where: str = ""

    def __post_init__(self) -> None:
        if self.state not in STATES:
            raise ValueError(f"{self.quantity}: no state {self.state!r}; choose from {STATES}")


def named(names: Iterable[str], between: str = ", ") -> str:
    """Names of elements, the first few of many: "a, b, c and 62 more"."""
    every = list(names)
    shown, rest = between.join(every[:MOST_NAMED]), len(every) - MOST_NAMED
    return f"{shown} and {rest} more" if rest > 0 else shown


def markdown(title: str, account: Sequence[Carried]) -> str:
    """The page `carried.md`: what is not carried first."""
    page = [
        f"# What was carried of {for_markdown(title)}",
        "",
        "| quantity | state | how, or why not | where |",
        "|---|---|---|---|",
    ]
    for line in sorted(account, key=lambda line: -STATES.index(line.state)):
        cells = (line.quantity, line.state, line.reason, line.where)
        page.append(f"| {' | '.join(for_markdown(text, cell=True) for text in cells)} |")
    return "\n".join(page) + "\n"


def terminal_lines(account: Sequence[Carried]) -> list[str]:
    """One line for each state that occurs: how many quantities, and the names of some."""
    found = []
    for state in STATES:
        quantities = dict.fromkeys(line.quantity for line in account if line.state == state)
        if quantities:
            found.append(f"{state} ({len(quantities)}): {named(quantities, '; ')}")
    return found


Accounts = dict[str, tuple[Carried, ...]]
"""By the names of the files that were read."""


def kept(folder: Path) -> Accounts:
    """The accounts in a run folder; lines that are none of ours are passed over."""
    try:
        found = lines.read(folder, LINES, _line).items
    except lines.UnreadableError:
        return {}
    accounts: dict[str, list[Carried]] = {}
    for title, line in found:
        accounts.setdefault(title, []).append(line)
    return {title: tuple(account) for title, account in accounts.items()}


def keep(folder: Path, file: Path, account: Sequence[Carried]) -> str:
    """Write the account of a file into a run folder, beside those of others.

    Returns:
        What it is called there: the file's name, with its folder's where another one has that name.
    """
    before, title = kept(folder), file.name
    if before.get(title, tuple(account)) != tuple(account):
        title = f"{file.absolute().parent.name}/{title}"
    every = before | {title: tuple(account)}
    if every == before:
        return title
    rows = [{"file": name, **line.to_wire()} for name, told in every.items() for line in told]
    write_whole(folder, LINES, "".join(json.dumps(row) + "\n" for row in rows).encode())
    pages = (markdown(name, told) for name, told in every.items())
    write_whole(folder, PAGE, "\n".join(pages).encode())
    return title


def _line(data: dict[str, Any], where: str) -> tuple[str, Carried]:
    names = ("file", "quantity", "state", "reason", "where")
    if set(data) - set(names) or not all(isinstance(data.get(n, ""), str) for n in names):
        raise ValueError(f"{where} is no line of an account")
    title, *rest = (data.get(name, "") for name in names)
    return title, Carried(*rest)
