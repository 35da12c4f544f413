"""On what the settings of a profile were chosen, so that nobody publishes on the same."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

FIRST_SEED = 10_001
"""Of a run that names no seed. No profile of any adapter was chosen on the hundred thousand seeds
from here on, and none of them is published."""

Sample = tuple[str, int]
"""Data set and number in it of a measured motion that a repetition is held against."""


@dataclass(frozen=True)
class Seen:
    """Seeds of a task, or measured motions, by whose results settings were chosen, or others
    rejected. Made by `seeds` or `motions`.

    Attributes:
        first, last: seeds, or numbers in the data set; both included.
        step: from one number to the next.
        task: whose seeds they are; empty for measured motions.
        data: the data set; empty for seeds.
    """

    first: int
    last: int
    step: int = 1
    task: str = ""
    data: str = ""

    @classmethod
    def seeds(cls, task: str, first: int, last: int) -> Seen:
        """Seeds of a task, by its name in records."""
        return cls(first, last, task=task)

    @classmethod
    def motions(cls, data: str, first: int, last: int, step: int = 1) -> Seen:
        """Motions of a data set, by its name."""
        return cls(first, last, step, data=data)

    def holds(self, task: str, seed: int, sample: Sample | None = None) -> bool:
        """Whether a repetition of that task and seed, held against that motion, was seen."""
        if not self.data:
            return task == self.task and self.first <= seed <= self.last
        if sample is None or sample[0] != self.data:
            return False
        return sample[1] in range(self.first, self.last + 1, max(1, self.step))

    def __str__(self) -> str:
        if self.data:
            every = "" if self.step == 1 else f" in steps of {self.step}"
            return f"{self.first} to {self.last}{every}"
        return str(self.first) if self.first == self.last else f"{self.first} to {self.last}"


def published_again(
    repetitions: Iterable[tuple[str, int, Sample | None, Iterable[Seen]]],
) -> str:
    """A sentence when repetitions are of what their settings were chosen on; else nothing. Each is
    given by task, seed, what it was held against, and what the settings were chosen on."""
    seen: dict[Seen, None] = {}
    hit = total = 0
    for task, seed, sample, declared in repetitions:
        holding = [s for s in declared if s.holds(task, seed, sample)]
        seen |= dict.fromkeys(holding)
        hit += bool(holding)
        total += 1
    if not hit:
        return ""
    if data := [what for what in seen if what.data]:
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
