"""Values near a point, and corners of all ranges, of the settings of each installed simulator."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.simulator.registry import adapter
from pytest_simbench.simulator.settings import Linear, Log, Searched, searched
from pytest_simbench.tuning.steps import between, corners, near, own_values

BASES = {name: adapter(name).profiles["tuned"] for name in ("mujoco", "drake", "sapien")}


def within(value: object, one: Searched) -> bool:
    if isinstance(one.over, tuple):
        return value in one.over
    return isinstance(value, int | float) and one.over.low <= value <= one.over.high


@given(st.sampled_from(sorted(BASES)), st.integers(0, 9))
def test_each_pair_of_ends_and_choices_meets_in_a_corner(name: str, seed: int) -> None:
    space = searched(type(BASES[name]))
    rows = corners(space, np.random.default_rng(seed))
    ends = {
        one.name: (one.over.low, one.over.high) if isinstance(one.over, Linear) else one.over
        for one in space
    }
    for a, b in itertools.combinations(ends, 2):
        met = {(row[a], row[b]) for row in rows}
        assert met >= {*itertools.product(ends[a], ends[b])}
    assert len(rows) < 4 * max(map(len, ends.values())) ** 2 + 9
    assert all(within(row[one.name], one) for row in rows for one in space)


@pytest.mark.parametrize("name", BASES)
def test_what_is_near_lies_in_the_range_and_is_another_value(name: str) -> None:
    base = BASES[name]
    space = searched(type(base))
    own = own_values(space, base)
    for one in space:
        values = near(own, one)
        assert values
        assert own.get(one.name) not in values
        assert all(within(value, one) for value in values)


@pytest.mark.parametrize(
    ("over", "whole", "own", "values"),
    [
        (Linear(0, 1), False, 0.2, [0, 1, 0.1, 0.6, 0.175, 0.3]),
        (Linear(0, 10), True, 4, [0, 10, 2, 7, 5]),  # an eighth of the way down is its own
        (Log(0.01, 100), False, 1.0, [0.01, 100, 0.1, 10, 0.5623, 1.778]),
        (Log(0.01, 100), False, None, [0.01, 100]), (("a", "b", "c"), False, "b", ["a", "c"]),
    ],
)  # fmt: skip
def test_what_is_near(over: Any, whole: bool, own: Any, values: list[Any]) -> None:
    """The ends, half the way to each, and an eighth of it; or the other choices."""
    one = Searched("x", None, over, whole, ())
    assert near({} if own is None else {"x": own}, one) == values
    if own == 0.2:
        assert [*corners([one], np.random.default_rng(1))] == [{"x": x} for x in (0, 0.5, 1)]


@given(st.floats(0, 1), st.floats(0, 1))
def test_farther_on_the_way_is_nearer_to_the_end(a: float, b: float) -> None:
    for one in searched(type(BASES["mujoco"])):
        if isinstance(one.over, Linear):
            low, high = one.over.low, one.over.high
            first, second = (between(low, high, one, share) for share in sorted((a, b)))
            assert low <= first <= second <= high
