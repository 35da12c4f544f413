"""More crashes than before: exact p values, and no more false alarms than promised."""

from __future__ import annotations

import numpy as np
import pytest

from pytest_simbench.measure.comparison import ALPHA
from pytest_simbench.measure.crashes import PART, corrected, rise


def crashed(*seeds: int, first: int = 0, of: int = 20) -> dict[int, float]:
    return {seed: float(seed in seeds) for seed in range(first, first + of)}


@pytest.mark.parametrize(
    ("before", "after", "p_value", "least"),
    [
        (crashed(), crashed(), 1.0, 1.0),
        (crashed(), crashed(1, 2, 3, 4, 5), 1 / 32, 1 / 32),
        (crashed(1, 2, 3, 4, 5), crashed(), 1.0, 1 / 32),
        (crashed(1, 2), crashed(1, 3, 4, 5), 5 / 16, 1 / 16),  # seed 1 says nothing
    ],
)
def test_pairs(
    before: dict[int, float], after: dict[int, float], p_value: float, least: float
) -> None:
    assert rise(before, after, True) == pytest.approx((p_value, least))


@pytest.mark.parametrize(("number", "p_value"), [(0, 1.0), (4, 0.05301), (5, 0.02356)])
def test_other_seeds_by_fisher(number: int, p_value: float) -> None:
    found = rise(crashed(first=100), crashed(*range(number)), False)
    assert found == pytest.approx((p_value, p_value), abs=1e-5)
    assert rise(crashed(*range(number)), crashed(first=100), False)[0] == 1.0


def test_only_those_that_could_be_significant_are_corrected_for_and_each_as_the_least_sure() -> (
    None
):
    few, five, even = (1 / 16, 1 / 16), (1 / 32, 1 / 32), (1.0, 1 / 64)
    assert corrected([few, (1.0, 1.0)]) == ([pytest.approx(1 / 16 / PART), 1.0], 1.0)
    assert corrected([five, few]) == (
        [pytest.approx(1 / 32 / PART), pytest.approx(1 / 16 / PART)],
        pytest.approx(1 - PART),
    )
    assert corrected([five, five])[0] == [pytest.approx(1 / 32 / PART)] * 2
    assert corrected([five, even])[0] == [pytest.approx(2 / 32 / PART), 1.0]
    assert 1 / 32 / PART <= ALPHA  # five of twenty against none


@pytest.mark.parametrize("paired", [True, False])
@pytest.mark.parametrize("tests", [1, 4, 12])
@pytest.mark.parametrize("rate", [0.05, 0.2, 0.5])
def test_runs_that_are_alike_alarm_at_most_as_often_as_their_part_of_the_error(
    rate: float, tests: int, paired: bool
) -> None:
    rng = np.random.default_rng(27)
    runs, cache = 1500, {}

    def chance(before: np.ndarray, after: np.ndarray) -> tuple[float, float]:
        key = (int((after > before).sum()), int((after != before).sum())) if paired else (
            int(before.sum()), int(after.sum()))  # fmt: skip
        if key not in cache:
            sides = (dict(enumerate(map(float, side))) for side in (before, after))
            cache[key] = rise(*sides, paired)
        return cache[key]

    false = 0
    for drawn in rng.random((runs, tests, 2, 20)) < rate:
        found = [chance(before.astype(int), after.astype(int)) for before, after in drawn]
        false += min(corrected(found)[0]) <= ALPHA
    allowed = ALPHA * PART
    assert false / runs <= allowed + 2 * (allowed * (1 - allowed) / runs) ** 0.5
