"""Where a search may go from a point: values of one setting near its own, and corners of all."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pytest_simbench.simulator.settings import Linear, Log, Searched, Settings

TRIES = 50
"""Draws of values for which a new or better one is looked for."""


def own_values(
    space: Sequence[Searched], base: Settings, changed: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """The values of settings, some changed, as far as they lie where is searched."""
    found = {}
    settings = {**vars(base), **(changed or {})}
    for one in space:
        value = settings[one.setting]
        value = value if one.part is None else value[one.part]
        inside = value in one.over if isinstance(one.over, tuple) else (
            value is not None and one.over.low <= value <= one.over.high
        )  # fmt: skip
        if inside:
            found[one.name] = value
    return found


def acts(one: Searched, settings: Mapping[str, Any]) -> bool:
    """Whether it acts with the others' values."""
    return not one.when or settings[one.when[0]] in one.when[1:]


def near(own: Mapping[str, Any], one: Searched) -> list[Any]:
    """Other values of a setting: the choices, or between its own and the ends of its range."""
    if isinstance(one.over, tuple):
        return [choice for choice in one.over if choice != own.get(one.name)]
    found = [one.over.low, one.over.high]
    if one.name in own:
        for share in (1 / 2, 1 / 8):
            found += [between(own[one.name], end, one, share) for end in found[:2]]
    return [value for value in found if value != own.get(one.name)]


def between(value: float, end: float, one: Searched, share: float = 1 / 2) -> float:
    """A share of the way to an end of the range; a whole number where the setting wants one."""
    if isinstance(one.over, Log):
        middle = value * (end / value) ** share
    else:
        middle = value + share * (end - value)
    return round(middle) if one.whole else float(f"{middle:.4g}")


def corners(space: Sequence[Searched], rng: np.random.Generator) -> list[dict[str, Any]]:
    """Rows of ends, middles and choices; each pair of settings meets in each way in one of them."""
    levels = {one.name: _levels(one) for one in space}
    left = [
        ((a, x), (b, y))
        for a, b in itertools.combinations(levels, 2) for x in levels[a] for y in levels[b]
    ]  # fmt: skip
    rows = [{name: x} for name, of in levels.items() for x in of] if len(levels) == 1 else []
    while left:
        drawn = [
            {name: of[int(rng.integers(len(of)))] for name, of in levels.items()} | dict(left[0])
            for _ in range(TRIES)
        ]
        met = [{*itertools.combinations(row.items(), 2)} for row in drawn]
        many = [sum(pair in pairs for pair in left) for pairs in met]
        best = many.index(max(many))
        rows.append(drawn[best])
        left = [pair for pair in left if pair not in met[best]]
    return rows


def _levels(one: Searched) -> Sequence[Any]:
    if not isinstance(one.over, Linear):
        return tuple(one.over)
    low, high = one.over.low, one.over.high
    return low, between(low, high, one), high
