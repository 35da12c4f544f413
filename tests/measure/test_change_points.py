"""Change points: planted ones are found where they are, and chance gives none."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from pytest_simbench.measure import change_points as module
from pytest_simbench.measure.change_points import PERMUTATIONS, _chance, _shifts, change_points

Row = list[dict[int, float]]


def row(
    levels: Sequence[float], rng: np.random.Generator, *, seeds: int = 10, ease: float = 3.0
) -> Row:
    """Values of releases with these true means and a spread of 1; seeds differ by `ease`."""
    own = rng.normal(0, ease, seeds)
    return [dict(enumerate(level + own + rng.normal(0, 1, seeds))) for level in levels]


def places(found: Row) -> list[int]:
    return [change.place for change in change_points(found)]


def test_planted_changes_are_found_where_they_are() -> None:
    """A step of two spreads, which ten repetitions of a release show, whatever the seeds' ease."""
    rng = np.random.default_rng(1)
    exact = [places(row([0] * 5 + [2] * 7, rng)) == [5] for _ in range(30)]
    assert sum(exact) >= 26
    both = [places(row([0] * 4 + [2] * 4 + [0] * 4, rng)) == [4, 8] for _ in range(30)]
    assert sum(both) >= 24


def test_the_levels_are_those_between_the_changes() -> None:
    values = [{1: 1.0, 2: 3.0, 3: 2.0, 4: 2.0, 5: 2.5}] * 3
    values += [{seed: x + 4 for seed, x in values[0].items()}] * 2
    (found,) = change_points(values)
    assert (found.place, found.before, found.after) == (3, pytest.approx(2.1), pytest.approx(6.1))
    assert found.p_value < 0.01


def test_a_split_counts_by_the_difference_of_its_means_and_by_how_many_values_tell_it() -> None:
    table = np.array([[[0.0, 2.0], [0.0, 2.0], [3.0, 5.0], [3.0, np.nan]]])
    means = (13 / 5 - 1, 11 / 3 - 1, 3 - 12 / 6)
    sizes = (2 * 5 / 7, 4 * 3 / 7, 6 * 1 / 7)
    told = [gap * size**0.5 for gap, size in zip(means, sizes, strict=True)]
    assert _shifts(table)[0] == pytest.approx(told)


def test_without_a_change_one_row_in_twenty_has_one_at_most() -> None:
    rng = np.random.default_rng(2)
    false = sum(bool(places(row([0.0] * 8, rng))) for _ in range(200))
    assert false <= 17  # 10 expected; more than 17 in 1 of 100 cases (binomial)


def test_many_rows_share_the_error() -> None:
    rng = np.random.default_rng(3)
    found = row([0] * 3 + [1.2] * 3, rng, seeds=6)
    (alone,) = change_points(found)
    assert alone.p_value < 0.05
    corrected = change_points(found, rows=10)
    assert not corrected or corrected[0].p_value == pytest.approx(10 * alone.p_value)


def test_what_never_varies_has_none_and_what_is_missing_is_left_out() -> None:
    assert places([{1: 1.0, 2: 1.0}] * 6) == []
    assert places([]) == []
    assert places([{1: 2.0}]) == []
    assert places([{1: 0.5}, {2: 0.5}]) == []
    rng = np.random.default_rng(4)
    found = row([0] * 4 + [3] * 4, rng)
    for k, seed in ((0, 3), (2, 7), (5, 0), (7, 9)):
        del found[k][seed]
    assert places(found) == [4]


@pytest.mark.parametrize("at_once", [10**6, 840])
def test_a_chance_is_a_share_of_all_orders_with_the_one_seen(
    at_once: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "AT_ONCE", at_once)
    part = np.arange(12.0).reshape(-1, 1)
    always, never = _chance(part, -np.inf), _chance(part, np.inf)
    assert (always, never) == (1.0, 1 / (PERMUTATIONS + 1))


def test_the_levels_are_of_the_seeds_that_both_sides_have() -> None:
    """Each seed is slower by 0.1; the slow ones have no value any more."""
    before = {seed: 1.0 + seed / 10 for seed in range(12)}
    after = {seed: value + 0.1 for seed, value in before.items() if seed < 8}
    (found,) = change_points([before] * 3 + [after] * 3)
    assert found.after - found.before == pytest.approx(0.1)
