"""On which seeds the settings of a profile were chosen, so that nobody publishes on the same."""

from __future__ import annotations

import importlib
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class SeedsSeen:
    """Seeds of a task by whose results settings were chosen, or others rejected.

    Attributes:
        task: its name, as in records.
        first, last: both included.
    """

    task: str
    first: int
    last: int

    def holds(self, task: str, seed: int) -> bool:
        """Whether a repetition of that task and seed was seen."""
        return task == self.task and self.first <= seed <= self.last

    def __str__(self) -> str:
        return str(self.first) if self.first == self.last else f"{self.first} to {self.last}"

    def to_wire(self) -> dict[str, Any]:
        return asdict(self)


def seeds_seen(adapter: str, profile: str) -> tuple[SeedsSeen, ...]:
    """What the adapter `module:Class` says of a profile; nothing where it says nothing."""
    module, _, name = adapter.partition(":")
    try:
        declared = getattr(importlib.import_module(module), name).chosen_on
    except (ImportError, AttributeError):  # an adapter that only its own interpreter can import
        return ()
    return tuple(declared.get(profile, ()))


def published_again(
    repetitions: Iterable[tuple[str, int, Iterable[Mapping[str, Any]]]],
) -> str:
    """A sentence when repetitions have seeds on which their settings were chosen; else nothing.

    Args:
        repetitions: task, seed, and what the record says of the profile (`to_wire` of each).
    """
    seen: dict[SeedsSeen, None] = {}
    hit = total = 0
    for task, seed, declared in repetitions:
        holding = [s for s in (SeedsSeen(**data) for data in declared) if s.holds(task, seed)]
        seen |= dict.fromkeys(holding)
        hit += bool(holding)
        total += 1
    if not hit:
        return ""
    seeds = " and ".join(map(str, seen))
    word = "seed" if len(seen) == 1 and next(iter(seen)).first == next(iter(seen)).last else "seeds"
    return (
        f"its settings were chosen on {word} {seeds} of this task, and {hit} of these {total} "
        "repetitions are of them: publish others (--sim-seed)"
    )
