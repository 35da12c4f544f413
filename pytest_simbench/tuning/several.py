"""Several tasks and laws at once: what is cheaper, and in none of them worse than today's settings.

Who tunes for one alone may lose another: a longer step holds towers and misses throws."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from pytest_simbench.simulator import Capability
from pytest_simbench.tasks.base import Task
from pytest_simbench.tuning.target import (
    CONVERGED,
    FLOOR,
    LAWS_WORD,
    MARGIN,
    Claims,
    Look,
    Target,
    TuningError,
    target,
)

MOST = 5.0
"""Margins by which a candidate may be worse in one of them before it is ended: the others are not
asked then."""


@dataclass(frozen=True)
class Several(Target):
    """Targets that are looked at one after the other, on the same seeds.

    The error of a candidate is by how many margins the worst of them is worse than today: up to 1
    is not worse; that one is better makes up for no other, and is no gain.

    Attributes:
        several: each with its own error.
        today: errors of today's settings on the same half, once they are known.
    """

    several: tuple[Target, ...] = ()
    most: float = MOST
    today: Mapping[Look, Any] = field(default_factory=dict)

    @property
    def parts(self) -> tuple[Target, ...]:
        return self.several

    @property
    def laws(self) -> bool:
        return False

    @property
    def unit(self) -> str:
        return "margins"

    @property
    def word(self) -> str:
        return "several"

    def beside(self, today: Mapping[Look, Any]) -> Several:
        return replace(self, today=dict(today))

    def error(self, look: Look, record: Any, first: Any) -> Any:
        part = next(part for part in self.parts if part.asks(look))
        return part.error(look, record, first)

    def comparable(self, looks: Collection[Look]) -> bool:
        return all(any(map(part.asks, looks)) for part in self.parts)

    def together(
        self, errors: Mapping[Look, Any], of: Sequence[Look] = (), least: float = FLOOR
    ) -> float:
        return max(0.0, *(self._worse(part, errors, of) for part in self.parts))

    def margin(self, errors: Mapping[Look, Any]) -> float:
        return 1.0

    def _worse(self, part: Target, errors: Mapping[Look, Any], of: Sequence[Look]) -> float:
        """By how many margins; a law by itself, as it is judged."""
        found, before = (
            {look: error for look, error in known.items() if part.asks(look)}
            for known in (errors, self.today)
        )
        if not (found and before):
            return 0.0
        if part.laws:
            most = max(error / part.allowed(before[look]) for look, error in found.items())
            return float(most * (1 + MARGIN) - 1) / MARGIN
        after = part.together(found, [look for look in of if part.asks(look)])
        return (after - part.together(before)) / part.margin(before)


def named(
    name: str,
    cost: str,
    error: str | None,
    seeds: int | None,
    judged: int,
    can: Collection[Capability] = tuple(Capability),
    asked: tuple[Task, Claims] | None = None,
) -> Target:
    """What a command line names: one target, or `NAME,NAME:METRIC,laws:NAME,...`. The arguments are
    those of `target`.

    Raises:
        TuningError: there is nothing of that name; lists what there is.
        DataMissing: the measured data are not here.
    """
    tasks, colon, laws = name.partition(f"{LAWS_WORD}:")
    names = [one for part in tasks.split(",") if (one := part.strip())]
    of_laws = colon + laws or LAWS_WORD * (LAWS_WORD in names)
    names = [one for one in names if one != LAWS_WORD]
    several = len(names) + bool(of_laws) > 1
    if asked or not (several or ":" in "".join(names)):
        return target(name, cost, error, seeds, judged, can, asked)
    if error is not None:
        raise TuningError("--error: write it behind the name, NAME:METRIC; of several each one's")
    parts = [target(of_laws, cost, None, seeds, judged, can)] if of_laws else []
    for one in names:
        task, _, metric = one.partition(":")
        if several and metric.partition(":")[0] == CONVERGED:
            raise TuningError(f"{one}: {CONVERGED} is an error of one task alone")
        parts.append(target(task, cost, metric or None, seeds, judged, can))
    if not several:
        return parts[0]
    if len({part.name for part in parts}) < len(parts):
        raise TuningError(f"{name}: it names one of them twice")
    chosen = [
        look
        for part in parts
        for look in part.chosen
        if look.number == 1 or not part.laws  # what many laws cost is no noise
    ]
    chosen.sort(key=lambda look: look.number > 1)  # each one once: then all costs are known
    kept = tuple(look for part in parts for look in part.judged)
    return Several(name, cost, tuple(chosen), kept, several=tuple(parts))
