"""What of a scene's file was carried into the scene, and what was not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from pytest_simbench.ground.text import for_markdown
from pytest_simbench.scene.wire import Wire

State = Literal["carried", "approximated", "not carried"]

STATES: tuple[State, ...] = ("not carried", "approximated", "carried")
"""What changes most comes first."""

NAMED = 3
"""How many elements a row names."""


@dataclass(frozen=True)
class Carried(Wire):
    """One quantity of a file.

    Attributes:
        quantity: in the words of the file: `geom solref`.
        state: whether the scene has it.
        reason: how, or why not and what that may change; one sentence.
        where: the elements that have it, by name.
    """

    quantity: str
    state: State
    reason: str
    where: tuple[str, ...] = ()


def in_order(account: Sequence[Carried]) -> list[Carried]:
    """What was not carried first."""
    return sorted(account, key=lambda row: STATES.index(row.state))


def as_markdown(name: str, account: Sequence[Carried]) -> str:
    """The account of a file as a page."""
    rows = [
        f"| {for_markdown(row.quantity)} | {row.state} | {for_markdown(row.reason)} | "
        f"{for_markdown(_places(row.where))} |"
        for row in in_order(account)
    ]
    head = "| of the file | | how, or why not | where |\n| --- | --- | --- | --- |"
    return "\n".join([f"# What was carried of {for_markdown(name)}", "", head, *rows, ""])


def as_lines(name: str, account: Sequence[Carried]) -> list[str]:
    """The same in a line for each state but `carried`, which all expect."""
    told = []
    for state in STATES[:-1]:
        quantities = [row.quantity for row in account if row.state == state]
        if quantities:
            told.append(f"{name}: {state}: {', '.join(quantities)} (carried.md says why)")
    return told


def _places(where: Sequence[str]) -> str:
    more = f" and {len(where) - NAMED} more" if len(where) > NAMED else ""
    return ", ".join(where[:NAMED]) + more
