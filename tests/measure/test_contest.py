"""Who beats whom: real differences are found, chance ones are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pytest_simbench.measure import comparison
from pytest_simbench.measure.contest import wins
from pytest_simbench.measure.record import Record

from .build import METRICS, failed, record


def side(rng: np.random.Generator, placed: float, **changes: object) -> list[Record]:
    """20 repetitions with about that share of 15 cubes placed."""
    return [
        record(k, metrics={"placed": rng.binomial(15, placed) / 15}, **changes) for k in range(20)
    ]


def names(sides: dict[str, list[Record]]) -> list[tuple[str, str, str]]:
    return [(w.winner, w.loser, w.metric.name) for w in wins(sides, METRICS)]


def test_the_better_side_wins_whichever_comes_first() -> None:
    rng = np.random.default_rng(1)
    good, poor = side(rng, 0.95), side(rng, 0.6)
    assert names({"good": good, "poor": poor}) == [("good", "poor", "placed")]
    assert names({"poor": poor, "good": good}) == [("good", "poor", "placed")]


def test_less_is_better_for_costs_and_errors() -> None:
    rng = np.random.default_rng(2)
    more = {"rss_mb": {"mean": 300.0}}
    slow = {"wall": 16.0, "cpu": 15.9, "simulated": 140.0}
    found = names({"a": side(rng, 0.9), "b": side(rng, 0.9, resources=more, stepping=slow)})
    assert set(found) == {("a", "b", name) for name in ("rtf", "cpu_cost", "ram")}


def test_failures_are_compared_too() -> None:
    a = [record(k, metrics={"placed": 1.0}) for k in range(20)]
    b = [*a[:8], *(failed(k) for k in range(8, 20))]
    assert ("a", "b", "failures") in names({"a": a, "b": b})
    ended = [replace(r, status="interrupted") for r in b[8:]]
    assert names({"a": a, "b": [*b[:8], *ended]}) == []


def test_a_metric_without_a_good_direction_is_won_by_nobody() -> None:
    a = [record(k, metrics={"landing_x": 1.0}) for k in range(20)]
    b = [record(k, metrics={"landing_x": 2.0}) for k in range(20)]
    assert names({"a": a, "b": b}) == []


def test_pairs_that_are_not_comparable_and_sides_without_values_are_left_out() -> None:
    rng = np.random.default_rng(3)
    sides = {"a": side(rng, 0.95), "b": side(rng, 0.5)}
    assert wins(sides, METRICS, comparable=lambda a, b: False) == []
    assert wins({"a": sides["a"], "b": []}, METRICS) == []
    assert wins({"a": sides["a"]}, METRICS) == []


def test_where_no_side_differs_a_win_is_rare(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four equal sides, six pairs: by chance one of twenty such matrices holds a win or more."""
    monkeypatch.setattr(comparison, "PERMUTATIONS", 999)
    rng = np.random.default_rng(4)
    placed = [m for m in METRICS if m.name == "placed"]
    found = 0
    for _ in range(60):
        sides = {name: side(rng, 0.8) for name in "abcd"}
        found += bool(wins(sides, placed))
    assert found <= 3 + 2 * 1.7  # two standard errors of 3 in 60


def test_many_true_differences_survive_the_correction() -> None:
    rng = np.random.default_rng(5)
    sides = {f"{rate:g}": side(rng, rate) for rate in (0.95, 0.7, 0.45, 0.2)}
    assert len([win for win in names(sides) if win[2] == "placed"]) == 6
