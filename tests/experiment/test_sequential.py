"""Sequential stopping: it decides what can be decided, and is wrong no more often than it says."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from pytest_simbench.experiment.sequential import Plan, SequentialResultSet
from pytest_simbench.measure import intervals
from pytest_simbench.measure.results import InconclusiveWarning
from pytest_simbench.measure.verdicts import ERROR, Verdict, at_least
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.record import Record
from tests.records.build import METRICS, failed, record

PLAN = Plan.up_to(160)


@pytest.fixture(autouse=True)
def remembered(monkeypatch: pytest.MonkeyPatch) -> None:
    """Equal counts have equal intervals: each is computed once, which saves minutes."""
    monkeypatch.setattr(intervals, "proportion", cache(intervals.proportion))


Draw = Callable[[], float]


def drawn(draw: Draw, metric: str = "hit", plan: Plan = PLAN) -> SequentialResultSet:
    """A result set whose repetitions are drawn when they are asked for."""
    records: list[Record] = []

    def more(number: int) -> list[Record]:
        while len(records) < number:
            records.append(record(len(records), metrics={metric: draw()}))
        return records

    return SequentialResultSet(more(plan.looks[0]), METRICS, plan, more)


def test_looks_double_up_to_the_limit_and_share_the_error() -> None:
    assert PLAN.looks == (10, 20, 40, 80, 160)
    assert PLAN.error == pytest.approx(0.01)
    assert Plan.up_to(50).looks == (10, 20, 40, 50)
    assert Plan.up_to(5) == Plan((5,), ERROR)


def test_it_stops_as_soon_as_the_claim_is_decided() -> None:
    result = drawn(lambda: 1.0)
    result.assert_at_least("hit", 0.5)
    assert len(result) == 10
    result.assert_at_least("hit", 0.9)  # 44 of 44 show 0.9 with 99 %: 0.01^(1 / 44)
    assert len(result) == 80


def test_a_refuted_claim_fails_with_the_level_of_its_interval() -> None:
    with pytest.raises(AssertionError, match=r"hit is 0 % .*\(99 % bounds .*, 10 repetitions\)"):
        drawn(lambda: 0.0).assert_at_least("hit", 0.5)


def test_at_the_limit_it_says_that_it_does_not_know() -> None:
    values = iter([0.0, 1.0] * 1000)
    result = drawn(lambda: next(values))
    with pytest.warns(InconclusiveWarning, match="99 % bounds .*160 repetitions.*inconclusive"):
        result.assert_at_least("hit", 0.5)
    assert len(result) == 160


def test_failures_are_a_claim_too() -> None:
    def more(number: int) -> list[Record]:
        return [failed(k) if k % 2 else record(k) for k in range(number)]

    result = SequentialResultSet(more(10), METRICS, PLAN, more)
    with pytest.raises(AssertionError, match=r"20 of 40 repetitions crashed.*99 % bounds"):
        result.assert_crashed_at_most(0.3)


def test_when_no_more_come_it_ends() -> None:
    records = [record(k, metrics={"hit": float(k % 2)}) for k in range(10)]
    result = SequentialResultSet(records, METRICS, PLAN, lambda number: records)
    with pytest.warns(InconclusiveWarning):
        result.assert_at_least("hit", 0.5)


def wrong(draw: Draw, metric: str, truth: float, runs: int) -> float:
    """Share of runs that decide a claim at the very truth one way: refuted it is wrong there, and
    supported it is wrong just below. The more frequent of the two."""
    verdicts = [drawn(draw, metric).judge(metric, at_least(truth)).verdict for _ in range(runs)]
    return max(map(verdicts.count, (Verdict.SUPPORTED, Verdict.REFUTED))) / runs


@pytest.mark.parametrize("rate", [0.5, 0.8, 0.9])
def test_false_alarms_of_yes_and_no_stay_below_one_in_twenty(rate: float) -> None:
    rng = np.random.default_rng(int(100 * rate))
    assert wrong(lambda: float(rng.random() < rate), "hit", rate, 400) <= 0.05


@pytest.mark.parametrize("simulator", ["mujoco", "pybullet"])
def test_false_alarms_of_real_shares_stay_below_one_in_twenty(simulator: str) -> None:
    path = Path(__file__).parents[1] / "measure" / "stacking_records.jsonl"
    pool = [
        r.metrics["at_end"] or 0.0
        for r in RunFolder.of(path).read().records
        if r.simulator == simulator
    ]
    rng = np.random.default_rng(7)
    truth = float(np.mean(pool))
    share = wrong(lambda: float(rng.choice(pool)), "placed", truth, 80)
    assert share <= 0.05 + 2 * (0.05 * 0.95 / 80) ** 0.5  # two standard errors


def test_looking_each_time_with_95_percent_would_be_wrong_more_often() -> None:
    """What the correction is for; without it the test above would not mean anything."""
    rng = np.random.default_rng(1)
    plan = Plan(PLAN.looks, ERROR)

    def decided() -> bool:
        result = drawn(lambda: float(rng.random() < 0.5), plan=plan)
        return result.judge("hit", at_least(0.5)).verdict.decided

    assert sum(decided() for _ in range(300)) / 300 > 0.10


def test_the_metric_of_the_claim_is_the_one_that_is_judged() -> None:
    assert isinstance(METRICS[0], Metric)
    result = drawn(lambda: 1.0, "placed")
    assert result.judge("placed", at_least(0.99)).interval.n == len(result) == 160
