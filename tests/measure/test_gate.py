"""The gate: planted changes are caught, neutral ones are not; every red has its test."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pytest_simbench.measure import comparison, gate
from pytest_simbench.measure.gate import GateReport, gate_runs, run_gate
from pytest_simbench.measure.limits import Limit, parse_limits
from pytest_simbench.records.description import TaskDescription
from pytest_simbench.records.folder import RunContents, RunFolder
from pytest_simbench.records.record import Record
from tests.records.build import METRICS, failed, record

REAL = RunFolder.of(Path(__file__).with_name("stacking_records.jsonl")).read().records
"""20 stacking repetitions of MuJoCo and 21 of PyBullet, as recorded, without their details."""


def run(baseline: Iterable[Record], current: Iterable[Record], text: str) -> GateReport:
    limits = parse_limits(text, METRICS) if text else ()
    return run_gate(baseline, current, limits, {"stacking": METRICS})


def made(
    values: Iterable[float], first_seed: int = 0, metric: str = "placed", **changes: Any
) -> list[Record]:
    return [
        record(k, seed=first_seed + k, metrics={metric: float(v)}, **changes)
        for k, v in enumerate(values)
    ]


def resampled(rng: np.random.Generator, simulator: str, loss: float = 0.0) -> list[Record]:
    """20 records drawn from the real ones, where each placed cube is lost with that chance more."""
    pool = [item for item in REAL if item.simulator == simulator]
    found = []
    for k, item in enumerate(rng.choice(len(pool), 20)):
        real = pool[item]
        cubes = rng.binomial(round(15 * (real.metrics["placed"] or 0)), 1 - loss)
        found.append(replace(real, repetition=k, seed=k, metrics={"placed": cubes / 15}))
    return found


@pytest.mark.parametrize("simulator", ["mujoco", "pybullet"])
def test_a_planted_loss_is_caught_and_no_change_is_not(
    simulator: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(comparison, "PERMUTATIONS", 999)
    monkeypatch.setattr(gate, "PERMUTATIONS", 999)
    rng = np.random.default_rng(20)
    limits = "placed:5%,ram:10%,rtf:20%"
    caught = false = 0
    for _ in range(100):
        baseline = resampled(rng, simulator)
        lost = run(baseline, resampled(rng, simulator, loss=0.10), limits)
        caught += any("placed fell" in failure for failure in lost.failures)
        false += bool(run(baseline, resampled(rng, simulator), limits).failures)
    assert caught >= 80
    assert false <= 5


def test_a_loss_in_clusters_needs_more_repetitions(monkeypatch: pytest.MonkeyPatch) -> None:
    """One repetition in five loses half its cubes: 10 points too; 20 repetitions are too few."""
    monkeypatch.setattr(comparison, "PERMUTATIONS", 499)
    rng = np.random.default_rng(25)
    pool = [item.metrics["placed"] or 0.0 for item in REAL if item.simulator == "mujoco"]

    def caught(number: int, runs: int) -> float:
        found = 0
        for _ in range(runs):
            before, after = rng.choice(pool, (2, number))
            after = np.where(rng.random(number) < 0.2, after / 2, after)
            found += bool(run(made(before), made(after), "placed:5%").failures)
        return found / runs

    assert caught(20, 30) < 0.8
    assert caught(45, 30) >= 0.8


def test_false_alarms_stay_below_one_in_twenty_even_without_a_margin(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Three limits of 0 %, two tests: six chances of a false alarm, in 100 neutral pairs."""
    monkeypatch.setattr(comparison, "PERMUTATIONS", 499)
    monkeypatch.setattr(gate, "PERMUTATIONS", 499)
    rng = np.random.default_rng(21)
    false = 0
    for _ in range(100):
        runs = [resampled(rng, "mujoco") + resampled(rng, "pybullet") for _ in range(2)]
        false += bool(run(*runs, "placed:0%,ram:0%,rtf:0%").failures)
    assert 1 <= false <= 5 + 2 * 2.2  # two standard errors of 5 in 100


MORE = {"rss_mb": {"mean": 180.0, "peak": 200.0}}
LANDING = {"metric": "landing_error"}


@pytest.mark.parametrize(
    ("before", "now", "limits", "given", "fails", "said"),
    [
        ([1.0] * 20, [0.8] * 20, "placed:5%", {}, True,
         "test_stacking[engine-headless]: placed fell from 100 % to 80 % (worse by 20 points, "
         "limit 5 points; p = 0.0001, 20 pairs)"),
        ([1.0] * 20, [0.95] * 20, "placed:5%", {}, False, "worse by 5 points"),  # no more than that
        ([1.0] * 20, [1.0] * 19 + [0.0], "placed:2%", {}, False, "worse by 5 points"),  # chance
        ([0.8] * 20, [1.0] * 20, "placed:5%", {}, False,
         "placed rose from 80 % to 100 % (worse by -20 points"),
        ([1.0] * 10, [1.0] * 10, "ram:10%,ram_peak:50%", {"resources": MORE}, True,
         "ram rose from 150 MB to 180 MB (worse by 20 %, limit 10 %"),
        ([0.25] * 12, [0.75] * 12, "landing_error:0.25", LANDING, True,
         "test_stacking[engine-headless]: landing_error rose from 0.25 m to 0.75 m (worse by 0.5 m,"
         " limit 0.25 m; p = 0.00024, 12 pairs)"),
        ([0.25] * 12, [0.75] * 12, "landing_error:0.5", LANDING, False, "worse by 0.5 m, limit 0."),
        ([0.25] * 12, [0.25] * 12, "landing_error:0.01", LANDING, False,
         "landing_error stayed from 0.25 m to 0.25 m"),
    ],
)  # fmt: skip
def test_what_is_worse_by_more_than_its_limit_and_not_by_chance_fails(
    before: list[float], now: list[float], limits: str, given: dict[str, Any], fails: bool,
    said: str,
) -> None:  # fmt: skip
    metric = given.get("metric", "placed")
    report = run(made(before, metric=metric), made(now, **given), limits)
    sentence = report.changes[0].sentence()
    assert said in sentence
    assert report.failures == (sentence,) * fails


def with_crashes(number: int, of: int = 20, **changes: Any) -> list[Record]:
    """Perfect stackings of which the last ones crashed."""
    crashed = [replace(failed(k), **changes) for k in range(of - number, of)]
    return [*made([1.0] * (of - number), **changes), *crashed]


@pytest.mark.parametrize("limits", ["", "rtf:20%", "placed:5%,ram:10%,rtf:20%"])
@pytest.mark.parametrize("number", [0, 1, 4, 5, 11, 13, 20])
def test_more_crashes_fail_whatever_the_limits(number: int, limits: str) -> None:
    report = run(with_crashes(0), with_crashes(number), limits)
    rose = f"crashed rose from 0 % to {5 * number} % (worse by {5 * number} points, limit 0 points"
    assert any(rose in failure for failure in report.failures) == (number >= 5)
    if number < 20:
        assert run(with_crashes(number), with_crashes(number), limits).failures == ()
        assert run(with_crashes(number), with_crashes(0), limits).failures == ()


def test_other_seeds_and_many_tests_do_not_hide_crashes() -> None:
    before = [replace(r, seed=r.seed + 500) for r in with_crashes(0)]
    assert "crashed rose" in run(before, with_crashes(5), "placed:50%").failures[0]
    assert run(before, with_crashes(4), "placed:50%").failures == ()
    sides = [
        [r for k in range(16) for r in with_crashes(more * (k < 2), test=f"test_{k}[engine]")]
        for more in (0, 5)
    ]
    found = run(*sides, "placed:50%").failures
    assert [sentence[:9] for sentence in found] == ["test_0[en", "test_1[en"]


def test_a_limit_on_crashes_allows_as_many() -> None:
    allowed = "crashed rose from 0 % to 50 % (worse by 50 points, limit 10 points"
    assert allowed in run(with_crashes(0), with_crashes(10), "crashed:10%").failures[0]
    assert run(with_crashes(0), with_crashes(10), "failures:50%").failures == ()


def test_crashes_count_in_shares_and_cost_nothing_where_there_is_none() -> None:
    report = run(with_crashes(0), with_crashes(6), "placed:5%")
    assert report.changes[0].comparison.second == pytest.approx(0.7)
    assert report.changes[0].p_value == pytest.approx(report.changes[0].comparison.p_value / 0.3)
    paper = run(with_crashes(0), with_crashes(6, protocol="paper"), "placed:5%")
    assert paper.changes[0].comparison.second == 1.0
    assert "crashed rose" in paper.failures[0]


def test_a_limit_that_compares_nothing_fails_and_says_why() -> None:
    here = made([1.0] * 7) + made([1.0] * 7, test="test_other[engine-headless]")
    text = "placed:5%,landing_error:1,ram:10%"
    report = run(here, here, text)
    both = "(test_stacking[engine-headless], test_other[engine-headless])"
    missing = f"landing_error:1 compared nothing: no repetition of the baseline has a value {both}"
    assert report.failures == (missing,)
    waiting = run_gate(here, here, parse_limits(text, METRICS), {"stacking": METRICS}, typed=False)
    assert waiting.failures == ()
    assert missing in waiting.notes
    nothing = run(here, made([1.0] * 7, test="test_x[e]"), "placed:5%")
    assert nothing.failures == (
        "nothing was compared: no test of this run is in the baseline (this run has test_x[e]; "
        "the baseline test_stacking[engine-headless], test_other[engine-headless])",
    )
    assert "this run has no repetition" in run(here, [], "placed:5%").failures[0]
    assert run_gate(here, [], (), {}, typed=False).failures == ()


@pytest.mark.parametrize(
    ("left", "why"),
    [
        (0, "no repetition of this run has a value"),
        (2, "2 of 6 repetitions of this run have a value, and a change takes 5 pairs or more"),
    ],
)
def test_a_value_that_one_test_has_lost_fails_a_typed_limit(left: int, why: str) -> None:
    """The limit is compared in another test: the run passed, with a note."""
    values = {"placed": 1.0, "landing_error": 0.1}
    here = [record(k, metrics=values) for k in range(6)]
    other = [replace(r, test="test_other[engine-headless]", function="test_other") for r in here]
    lost = other[:left] + [replace(r, metrics={"placed": 1.0}) for r in other[left:]]
    limits = parse_limits("landing_error:1", METRICS)
    for typed in (True, False):
        sides = [*here, *other], [*here, *lost]
        report = run_gate(*sides, limits, {"stacking": METRICS}, typed=typed)
        told = f"test_other[engine-headless]: landing_error:1 is not tested: {why}"
        failed = [t for t in report.failures if t.startswith(told)]
        assert bool(failed) is typed
        rose = [t for t in report.failures if "repetitions without landing_error rose" in t]
        assert len(rose) == (not typed and not left)  # of the ini file
        assert [*report.failures] == failed + rose
        assert any(t.startswith(told) for t in (*report.failures, *report.notes))


def test_values_that_get_fewer_are_told_and_fail() -> None:
    """The run passed on those that were left."""
    here = made([0.1] * 12, metric="landing_error")
    half = [replace(r, metrics={}) if r.seed % 2 else r for r in here]
    (told,) = run(here, half, "landing_error:1").failures
    assert "repetitions without landing_error rose from 0 % to 50 % (worse by 50 points" in told
    assert run(half, here, "landing_error:1").failures == ()


def test_seeds_pair_where_they_can() -> None:
    rng = np.random.default_rng(22)
    before = np.round(rng.uniform(0.3, 0.9, 20), 3)
    after = before - 0.06
    paired = run(made(before), made(after), "placed:5%")
    others = run(made(before), made(after, first_seed=500), "placed:5%")
    assert paired.changes[0].comparison.paired
    assert len(paired.failures) == 1
    assert not others.changes[0].comparison.paired
    assert others.failures == ()


def timed(wall: float, control: float | None, rng: np.random.Generator) -> list[Record]:
    """20 repetitions whose stepping took about `wall` seconds, and the control beside each."""
    found = []
    for k, noise in enumerate(rng.normal(1, 0.03, (20, 2))):
        stepping = {"wall": wall * noise[0], "cpu": wall, "simulated": 140.0}
        if control is not None:
            stepping |= {"control_wall": control * noise[1], "control_cpu": control}
        found.append(record(k, metrics={"placed": 1.0}, stepping=stepping))
    return found


def test_a_slow_machine_passes_and_a_real_slowdown_does_not() -> None:
    rng = np.random.default_rng(23)
    baseline = timed(8.0, 0.1, rng)
    slow_machine = run(baseline, timed(16.0, 0.2, rng), "rtf:20%")
    assert slow_machine.failures == ()
    assert slow_machine.changes[0].normalised
    slow_engine = run(baseline, timed(16.0 / 0.7, 0.2, rng), "rtf:20%")
    assert "rtf fell from 17.5 to 12." in slow_engine.failures[0]
    assert "machine speed taken out" in slow_engine.failures[0]


def test_another_machine_without_a_control_is_no_change_of_the_simulator() -> None:
    rng = np.random.default_rng(1)
    before, slow = timed(8.0, None, rng), timed(16.0, None, rng)
    elsewhere = [replace(record, host={"cpu": "another", "cores": 8}) for record in slow]
    slower = run(before, slow, "rtf:20%")
    assert (len(slower.failures), slower.changes[0].normalised) == (1, False)
    report = run(before, elsewhere, "rtf:20%")
    (failure,) = report.failures
    assert failure.startswith("rtf:20% compared nothing: it depends on the machine, which was ano")
    with_control = [replace(r, host={"cpu": "another"}) for r in timed(16.0, 2e-4, rng)]
    assert len(run(timed(8.0, 2e-4, rng), with_control, "rtf:20%").failures) == 1


def test_what_cannot_be_compared_is_said() -> None:
    baseline = made([1.0] * 3, test="kept") + made([1.0] * 3, test="gone")
    current = made([1.0] * 3, test="kept") + made([1.0] * 3, test="new")
    current[0] = replace(current[0], metrics={"placed": 1.0, "landing_error": 1.0})
    report = run(baseline, current, "placed:5%")
    assert report.failures == (
        "no limit can fail with so few repetitions; raise --reps in both runs",
    )
    assert report.notes == (
        "gone is in the baseline but did not run",
        "kept: 3 pairs are too few for a change of placed to be significant among 1 comparisons",
        "new is not in the baseline and is not compared",
    )


def test_what_has_no_limit_is_tested_in_both_directions_and_fails_nothing() -> None:
    """And corrected among itself: a thing that changed shows, whichever way."""
    sides = (
        [record(k, metrics={"placed": 0.5, "hit": hit, "landing_x": 1.0 + hit}) for k in range(20)]
        for hit in (0.0, 1.0)
    )
    report = run(*sides, "placed:5%")
    assert report.failures == ()
    assert [change.metric.name for change in report.changes] == ["placed", "crashed"]
    costs = ["rtf", "cpu", "ram", "ram_peak", "cpu_cost", "start", "end", "total"]
    assert [change.metric.name for change in report.others] == ["hit", *costs]
    others = {change.metric.name: change for change in report.others}
    assert others["hit"].significant
    assert others["hit"].loss == -1.0
    assert others["hit"].p_value == pytest.approx(9 * others["hit"].comparison.p_value)
    assert not others["ram"].significant
    assert others["hit"].limit == Limit("hit", 0.0, True)
    assert not any(change.normalised for change in report.others)


def test_what_is_certain_and_what_nothing_can_show_make_nothing_less_sure() -> None:
    """82 laws, each asked once, hid what a task beside them had lost."""
    laws = [
        record(1, test=f"test_law[{k}]", metrics={"placed": 1.0}).noting(sole=bool(k % 2))
        for k in range(82)
    ]
    before, after = made([1.0] * 8), made([0.8] * 8)
    alone = run(before, after, "placed:5%").changes[0]
    (found,) = (
        c for c in run([*laws, *before], [*laws, *after], "placed:5%").changes if c.exceeded
    )
    assert (found.test, found.p_value) == (alone.test, alone.p_value)


def test_how_few_are_too_few() -> None:
    """The smallest p value of n pairs is 1 / 2^n, of n and m others 1 / (n + m over n)."""

    def notes(first: int, second: int, text: str = "placed:5%", seed: int = 0) -> tuple[str, ...]:
        return run(made([1.0] * first), made([1.0] * second, first_seed=seed), text).notes

    vain = "no limit can fail with so few repetitions; raise --reps in both runs"
    few = made([1.0] * 4)
    assert run(few, made([0.0] * 4), "placed:5%").failures == (vain,)
    waiting = parse_limits("placed:5%", METRICS)
    assert not run_gate(few, few, waiting, {"stacking": METRICS}, typed=False).failures
    assert run([*few, *made([1.0] * 7, test="test_x[e]")], few, "placed:5%").failures == (vain,)
    assert "4 pairs are too few" in notes(4, 4)[0]
    assert notes(5, 5) == ()
    assert "3 and 2 repetitions are too few" in notes(3, 2, seed=500)[0]
    assert notes(3, 3, seed=500) == ()  # 1 of 20 is 0.05
    assert "20 and 1 repetitions are too few" in notes(20, 1)[0]  # one is told from no chance
    two = "placed:5%,ram:10%"
    assert notes(5, 5, two) == tuple(
        f"test_stacking[engine-headless]: 5 pairs are too few for a change of {name} to be "
        "significant among 2 comparisons"
        for name in ("placed", "ram")
    )
    assert notes(6, 6, two) == ()
    hit = made([1.0] * 4, metric="hit"), made([0.0] * 4, metric="hit")
    assert run(*hit, "").notes == (
        "metrics without a limit: 4 pairs are too few for a change to be significant among 1 "
        "comparisons",
    )


def test_many_comparisons_can_fail_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """As many permutations are drawn as the correction for their number takes."""
    monkeypatch.setattr(gate, "PERMUTATIONS", 99)
    before = [r for k in range(8) for r in made([1.0] * 9, test=f"test_{k}[e]")]
    after = [r for k in range(8) for r in made([1.0 - (k == 3)] * 9, test=f"test_{k}[e]")]
    (failure,) = run(before, after, "placed:5%").failures
    assert failure.startswith("test_3[e]: placed fell from 100 % to 0 %")


def test_a_test_that_is_broken_is_told_beside_its_limits() -> None:
    """Only where the baseline had results, and the run has failures."""
    nothing = [failed(k) for k in range(5)]
    assert run(nothing, nothing, "placed:5%").failures == ()
    assert run(made([1.0] * 5), made([1.0] * 5), "placed:5%").broken == ()
    report = run(made([1.0] * 5), [failed(5, "WorkerDied"), *nothing], "placed:5%")
    assert report.broken == report.failures[:1]
    assert report.broken == (
        "test_stacking[engine-headless]: none of 6 repetitions finished (most often WorkerHung in "
        "settle); 5 of 5 did in the baseline",
    )


def test_what_a_metric_meant_before_is_told_first() -> None:
    here, there = TaskDescription("stacking", METRICS), replace(METRICS[0], better="lower")
    before = RunContents("old", tuple(made([1.0] * 5)), {"stacking": here})
    told = {"stacking": TaskDescription("stacking", (there, *METRICS[1:]))}
    now = RunContents("new", tuple(made([0.5] * 5, settings={"timestep": 0.001})), told)
    (lower,), (higher,) = (parse_limits("placed:5%", of) for of in ((there,), METRICS))
    report = gate_runs(before, now, [lower])
    assert report.differences[0].startswith("better of the metric placed of stacking was")
    assert any("timestep" in difference for difference in report.differences[1:])
    assert report.failures == ()  # less is better now
    assert len(gate_runs(now, before, [higher]).changes) == 2


def test_of_many_tests_the_first_three_are_named() -> None:
    before = [r for k in range(3) for r in made([1.0], test=f"a{k}")]
    now = [r for k in range(4) for r in made([1.0], test=f"b{k}")]
    (told,) = run(before, now, "placed:5%").failures
    assert told.endswith("(this run has b0, b1, b2, ...; the baseline a0, a1, a2)")


def test_runs_of_different_robots_are_not_comparable() -> None:
    """Their tests have different names, and the report says why."""
    own = made([1.0] * 5, test="t[sim-headless]")
    ur5 = made([1.0] * 5, test="t[sim-headless-ur5]", robot={"name": "ur5"})
    sentence = (
        "the baseline was made with the tasks' own robot, this run with ur5: different robots are "
        "not comparable"
    )
    assert sentence in run(own, ur5, "placed:5%").notes
    two = [*ur5, *made([1.0] * 5, test="t[sim-headless-so101]", robot={"name": "so101"})]
    assert sentence.replace("ur5", "so101 and ur5") in run(own, two, "placed:5%").notes
    assert not any("robot" in note for note in run(ur5, ur5, "placed:5%").notes)
