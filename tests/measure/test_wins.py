"""Who beats whom: real differences are found, chance ones are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pytest_simbench.measure import comparison
from pytest_simbench.measure.wins import wins
from pytest_simbench.records.record import Record
from tests.records.build import METRICS, failed, record


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
    assert ("a", "b", "crashed") in names({"a": a, "b": b})
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


def planted(values: dict[str, list[float]], name: str) -> dict[str, list[Record]]:
    """Sides whose repetitions have these values of a metric."""
    return {
        side: [record(k, metrics={name: value}) for k, value in enumerate(found)]
        for side, found in values.items()
    }


def test_a_small_p_value_among_many_is_no_win() -> None:
    """By itself the pair is a win; among 36 pairs of nine sides it is to be expected."""
    high, low = [1.0] * 10, [1.0] * 3 + [0.0] * 7
    pair = planted({"a": high, "b": low}, "hit")
    pair["b"] = [replace(r, seed=r.seed + 500) for r in pair["b"]]
    (found,) = wins(pair, METRICS)
    assert (found.winner, found.loser, found.metric.name) == ("a", "b", "hit")
    # Tested are hit and failures, and rtf, CPU cost and RAM, in which all are the same.
    assert found.p_value == pytest.approx(5 * found.comparison.p_value)
    assert 0.002 < found.comparison.p_value < 0.01
    middle = [1.0] * 7 + [0.0] * 3
    crowd = planted({f"s{n}": middle for n in range(7)}, "hit")
    assert wins({**pair, **crowd}, METRICS) == []


@pytest.mark.parametrize("n", [2, 3, 4])
def test_fewer_than_five_repetitions_win_nothing(n: int) -> None:
    costs = {"stepping": {"wall": 80.0, "cpu": 79.0, "simulated": 140.0}}
    good = [record(k, metrics={"placed": 1.0}) for k in range(n)]
    poor = [record(50 + k, metrics={"placed": 0.0}, **costs) for k in range(n)]
    assert wins({"good": good, "poor": poor}, METRICS) == []


def test_what_cannot_vary_wins_nothing() -> None:
    """A deterministic engine lands in the same place whatever the seed: the micrometres between
    its repetitions are rounding, and twenty of them are one value."""
    rng = np.random.default_rng(6)
    same = {name: list(at + 1e-6 * rng.random(20)) for name, at in (("a", 0.013), ("b", 0.025))}
    assert wins(planted(same, "landing_error"), METRICS) == []
    spread = list(0.04 + 0.004 * rng.random(20))
    assert wins(planted({**same, "c": spread}, "landing_error"), METRICS) == []
    wide = {"a": list(0.013 + 0.004 * rng.random(20)), "c": spread}
    assert names(planted(wide, "landing_error")) == [("a", "c", "landing_error")]


def test_a_difference_below_the_resolution_is_no_win() -> None:
    rng = np.random.default_rng(7)
    first = list(0.013 + 0.004 * rng.random(20))
    for gap, won in ((0.0005, False), (0.0020, True)):
        sides = planted({"a": first, "b": [x + gap for x in first]}, "landing_error")
        assert bool(wins(sides, METRICS)) is won


def test_comparable_is_asked_about_both_sides() -> None:
    rng = np.random.default_rng(8)
    sides = {"a": side(rng, 0.95), "b": side(rng, 0.5), "c": side(rng, 0.1)}
    asked: list[tuple[str, str]] = []

    def ask(first: str, second: str) -> bool:
        asked.append((first, second))
        return {first, second} == {"a", "c"}

    found = wins(sides, METRICS, ask)
    assert {(w.winner, w.loser) for w in found} == {("a", "c")}
    assert set(asked) == {("a", "b"), ("a", "c"), ("b", "c")}


def test_a_win_carries_its_test() -> None:
    rng = np.random.default_rng(1)
    (win,) = wins({"good": side(rng, 0.95), "poor": side(rng, 0.6)}, METRICS)
    assert win.comparison.n == (20, 20)
    assert abs(win.comparison.difference) > 0.2
    assert win.comparison.p_value <= win.p_value <= 0.05


def test_five_repetitions_may_win() -> None:
    good = [record(k, metrics={"placed": 1.0}) for k in range(5)]
    poor = [record(50 + k, metrics={"placed": 0.0}) for k in range(5)]
    placed_only = [m for m in METRICS if m.name == "placed"]
    assert [w.winner for w in wins({"good": good, "poor": poor}, placed_only)] == ["good"]
