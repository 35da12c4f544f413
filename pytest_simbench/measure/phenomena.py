"""Which simulator is right about what: a verdict on each phenomenon from the laws that are kept.

Laws are no sample of anything and a deterministic simulator repeats itself, so there is nothing to
be estimated from their spread: on the laws that were run, who keeps what is a fact. What is left
open is the size of a tolerance, which is a bound. So what is missed by less than twice its
tolerance speaks against nobody."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

KEPT = 1.0
"""A law is kept up to so many tolerances."""

BROKEN = 2.0
"""Beyond so many it is broken; in between it decides nothing."""

Ratios = Mapping[str, float]
"""Error over tolerance by law; infinite where the repetition failed."""


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


def better(one: Ratios, other: Ratios) -> bool:
    """Whether the first keeps a law that the second breaks, and breaks none that the second
    keeps."""
    return bool(_kept(one) & _broken(other)) and not _kept(other) & _broken(one)


def verdict(found: Mapping[str, Ratios]) -> PhenomenonVerdict:
    """The verdict on the laws of one phenomenon, which are given by contender."""
    laws = {law for ratios in found.values() for law in ratios}
    compared = {who: ratios for who, ratios in found.items() if ratios.keys() == laws}
    unbeaten = tuple(
        who
        for who, ratios in compared.items()
        if not any(better(other, ratios) for other in compared.values())
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
        {who: len(_kept(ratios)) for who, ratios in compared.items()},
        tuple(who for who in found if who not in compared),
    )


def worst(ratios: Ratios) -> float:
    """The largest ratio: a simulator is trusted with a phenomenon as far as with its worst law. A
    median would hide one broken law of eight."""
    return max(ratios.values(), default=math.nan)


def _kept(ratios: Ratios) -> set[str]:
    return {law for law, ratio in ratios.items() if ratio <= KEPT}


def _broken(ratios: Ratios) -> set[str]:
    return {law for law, ratio in ratios.items() if ratio > BROKEN}
