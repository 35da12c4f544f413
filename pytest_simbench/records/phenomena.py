"""What laws are grouped by (`laws`), for tables too."""

from __future__ import annotations

from collections.abc import Iterable

PHENOMENA = (
    "free motion",
    "impact",
    "sticking",
    "sliding",
    "rolling",
    "stacking",
    "grasping",
    "joints",
    "mechanisms",
    "pushing",
)
"""In the order of tables; `joints` with their drives, `mechanisms` what not every simulator can be
asked: loops of links, links that collide, and what a joint transmits."""

PHENOMENON = "task.phenomenon"
"""Where a record's settings say that it is of a law, and of which phenomenon."""


def ordered(names: Iterable[str]) -> list[str]:
    """Phenomena, each once, in their order; one that is not known here comes last."""
    there = dict.fromkeys(names)
    known = [name for name in PHENOMENA if name in there]
    return [*known, *(name for name in there if name not in known)]
