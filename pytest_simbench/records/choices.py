"""On what the settings of a profile were chosen, so that nobody publishes on the same."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

FIRST_SEED = 10_001
"""Of a run that names no seed. No profile of any adapter was chosen on the hundred thousand seeds
from here on, and none of them is published."""

DeclaredSample = tuple[str, int] | None
"""Data set and number of the measured motion that a repetition was held against, if it was."""


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

    def holds(self, task: str, seed: int, sample: DeclaredSample = None) -> bool:
        """Whether a repetition of that task and seed was seen."""
        return task == self.task and self.first <= seed <= self.last

    def __str__(self) -> str:
        return str(self.first) if self.first == self.last else f"{self.first} to {self.last}"

    def to_wire(self) -> dict[str, Any]:
        return asdict(self)


@dataclass(frozen=True)
class DataSeen:
    """Measured motions by whose simulation settings were chosen, or others rejected.

    Attributes:
        data: name of the data set.
        first, last: numbers in the set, both included.
        step: from one number to the next.
    """

    data: str
    first: int
    last: int
    step: int = 1

    def holds(self, task: str, seed: int, sample: DeclaredSample = None) -> bool:
        """Whether a repetition that was held against that motion was seen."""
        if sample is None or sample[0] != self.data:
            return False
        return sample[1] in range(self.first, self.last + 1, self.step)

    def __str__(self) -> str:
        every = "" if self.step == 1 else f" in steps of {self.step}"
        return f"{self.first} to {self.last}{every}"

    def to_wire(self) -> dict[str, Any]:
        return asdict(self)


Seen = SeedsSeen | DataSeen


def _seen(data: Mapping[str, Any]) -> Seen:
    return DataSeen(**data) if "data" in data else SeedsSeen(**data)


def published_again(
    repetitions: Iterable[tuple[str, int, DeclaredSample, Iterable[Mapping[str, Any]]]],
) -> str:
    """A sentence when repetitions are of what their settings were chosen on; else nothing.

    Args:
        repetitions: task, seed, what it was held against, and what the record says of the profile
            (`to_wire` of each).
    """
    seen: dict[Seen, None] = {}
    hit = total = 0
    for task, seed, sample, declared in repetitions:
        holding = [s for s in map(_seen, declared) if s.holds(task, seed, sample)]
        seen |= dict.fromkeys(holding)
        hit += bool(holding)
        total += 1
    if not hit:
        return ""
    data = [what for what in seen if isinstance(what, DataSeen)]
    if data:
        sets = " and ".join(f"{what} of {what.data}" for what in data)
        return (
            f"its settings were chosen on numbers {sets}, and {hit} of these {total} repetitions "
            "are held against them: publish others"
        )
    seeds = " and ".join(map(str, seen))
    one = len(seen) == 1 and " " not in seeds
    return (
        f"its settings were chosen on {'seed' if one else 'seeds'} {seeds} of this task, and {hit} "
        f"of these {total} repetitions are of them: publish others (--sim-seed)"
    )
