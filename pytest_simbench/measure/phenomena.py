"""Which simulator is right about what: a verdict on each phenomenon from the laws that are kept.

Laws are no sample of anything and a deterministic simulator repeats itself, so there is nothing to
be estimated from their spread: on the laws that were run, who keeps what is a fact. What is left
open is the size of a tolerance, which is a bound. So what is missed by less than twice its
tolerance speaks against nobody."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

KEPT = 1.0
"""A law is kept up to so many tolerances."""

BROKEN = 2.0
"""Beyond so many it is broken; in between it decides nothing."""


class Miss(NamedTuple):
    """By how much a law is missed; infinite where the repetition failed.

    Attributes:
        ratio: error over tolerance, which grows with the time step.
        error: in the law's unit.
    """

    ratio: float
    error: float


Misses = Mapping[str, Miss]
"""By law."""


@dataclass(frozen=True)
class PhenomenonVerdict:
    """Who is right about one phenomenon.

    Attributes:
        laws: how many everybody was asked.
        best: who is better than everybody else, if anybody is.
        unbeaten: than whom nobody is better, in their order.
        kept: laws kept by each of those compared.
        incomplete: who did not do all laws, and is not compared.
    """

    laws: int
    best: str | None
    unbeaten: tuple[str, ...]
    kept: Mapping[str, int]
    incomplete: tuple[str, ...]


def better(one: Misses, other: Misses) -> bool:
    """Whether the first keeps a law that the second breaks, and breaks none that the second
    keeps. Who breaks a law with the smaller error, since its step is smaller, is no worse there."""
    return _ahead(one, other) and not _ahead(other, one)


def _ahead(one: Misses, other: Misses) -> bool:
    return any(one[law].error < other[law].error for law in _kept(one) & _broken(other))


def verdict(found: Mapping[str, Misses]) -> PhenomenonVerdict:
    """The verdict on the laws of one phenomenon, which are given by contender."""
    laws = {law for misses in found.values() for law in misses}
    compared = {who: misses for who, misses in found.items() if misses.keys() == laws}
    unbeaten = tuple(
        who
        for who, misses in compared.items()
        if not any(better(other, misses) for other in compared.values())
    )
    best = [
        who
        for who in unbeaten
        if len(compared) > 1
        and all(better(compared[who], compared[other]) for other in compared if other != who)
    ]
    return PhenomenonVerdict(
        len(laws),
        best[0] if best else None,
        unbeaten,
        {who: len(_kept(misses)) for who, misses in compared.items()},
        tuple(who for who in found if who not in compared),
    )


def worst(misses: Misses) -> float:
    """The largest ratio: a simulator is trusted with a phenomenon as far as with its worst law. A
    median would hide one broken law of eight."""
    return max((miss.ratio for miss in misses.values()), default=math.nan)


def _kept(misses: Misses) -> set[str]:
    return {law for law, miss in misses.items() if miss.ratio <= KEPT}


def _broken(misses: Misses) -> set[str]:
    return {law for law, miss in misses.items() if miss.ratio > BROKEN}
