"""What another engine's importer did not keep of a file, held against MuJoCo's own model of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from pytest_simbench.description.carried import named
from pytest_simbench.simulator import Deviation

from .account import values_of
from .reading import Reading

Told = tuple[str, str]
"""What was not kept, and the sentence about it."""

CLOSE = 2e-5
"""Share, and of places [m], by which values may differ: both engines have single precision."""


def compared(
    what: str, made: Any, asked: Any, names: Iterable[str], close: float = 0.0
) -> Iterator[Told]:
    """What is told where rows differ by more than a share, and `close` beside it."""
    made, asked = (np.atleast_2d(np.transpose(values)).T for values in (made, asked))
    rows: Any = ~np.isclose(made, asked, rtol=CLOSE, atol=close, equal_nan=True).all(axis=1)
    if rows.any():
        where = dict.fromkeys(name for name, differs in zip(names, rows, strict=True) if differs)
        values = f"{values_of(made[rows])}, in the file {values_of(asked[rows])}"
        yield what, f"{what} is {values} ({named(where)})"


def deviations(who: str, told: Iterable[Told], excused: Mapping[str, str]) -> Iterator[Deviation]:
    """A sentence each, and one for the quantities of the parity check that differ with them."""
    patterns = []
    for what, sentence in told:
        yield Deviation("", f"{who}: {sentence}")
        patterns += [excused[what]] if what in excused else []
    if patterns:
        yield Deviation(" ".join(patterns), f"as {who} has it")


def pairs(own: Reading, solid: list[int]) -> tuple[Any, list[str]]:
    """Which two of these shapes are asked about, as one of them moves; names of their bodies."""
    still = np.array([not own.root_of(geom) for geom in solid], dtype=bool)
    ask = np.triu(np.ones((len(still),) * 2, dtype=bool)) & ~np.outer(still, still)
    owners = [own.name("body", int(own.model.geom_bodyid[geom])) for geom in solid]
    return ask, [f"{owners[a]} and {owners[b]}" for a, b in np.argwhere(ask)]
