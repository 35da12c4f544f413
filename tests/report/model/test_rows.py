"""From records to rows: what is counted, what is left out, and how values are pooled and shown."""

from __future__ import annotations

import math
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.measure.results import ResultSet
from pytest_simbench.records.metrics import Metric
from pytest_simbench.report.model import cells, tables
from pytest_simbench.report.model.cells import interval, metric_value, number
from pytest_simbench.report.model.pooling import merged_order, pooled, pooled_by_phase, spread
from pytest_simbench.report.model.summary import Row, summarise
from tests.report.samples import (
    METRICS,
    REFERENCES,
    STACKING,
    failed,
    record,
    stacking_run,
    texts,
    throwing_run,
)

LATE = Metric("late", "late", unit="s")
CUBES = Metric("moved", "moved", unit="cubes")
SHARE = Metric("placed", "placed", kind="share", of=15)


def only(*records: Any) -> Row:
    (row,) = summarise(records, METRICS)[0].rows
    return row


def test_one_summary_per_task_and_one_row_per_simulator_and_mode() -> None:
    records = throwing_run() + stacking_run("gui") + stacking_run()
    summaries = summarise(reversed(records), METRICS, REFERENCES)
    found = [(s.task, [row.label for row in s.rows]) for s in summaries]
    four = [
        f"{name} {mode} tuned" for name in ("mujoco", "pybullet") for mode in ("headless", "gui")
    ]
    assert found == [("stacking", four), ("throwing", four[::2])]
    assert [m.name for m in summaries[0].study] == ["placed", "at_end"]
    assert summaries[1].references == REFERENCES["throwing"]
    assert summarise([], METRICS) == []


def test_names_say_no_more_than_they_must() -> None:
    (both,) = summarise(stacking_run() + stacking_run("gui"), METRICS)
    assert both.names[:2] == ["mujoco (headless)", "mujoco (gui)"]
    assert summarise(stacking_run(), METRICS)[0].names == ["mujoco", "pybullet"]
    two = [record(test="test_a[mujoco-headless]"), record(test="test_b[mujoco-headless]")]
    assert summarise(two, METRICS)[0].names == ["mujoco (test_a)", "mujoco (test_b)"]


def test_failed_repetitions_count_and_interrupted_ones_are_left_out() -> None:
    row = only(
        record(repetition=1, metrics={"placed": 0.8}),
        record(repetition=2, metrics={"placed": 0.6}),
        failed("WorkerHung", "settle", "no\nanswer", repetition=3, metrics={"placed": 0.0}),
        failed("WorkerHung", "settle", "none", repetition=5),
        failed("WorkerDied", "pick", "gone", repetition=6),
        record(repetition=7, status="interrupted", metrics={"placed": 0.0}),
    )
    assert (row.finished, row.failed, row.interrupted, row.attempts) == (2, 3, 1, 5)
    placed = row.metrics["placed"]
    assert (placed.count, placed.min, placed.max) == (5, 0.0, 0.8)  # a crash is the worst
    assert placed.mean == pytest.approx(1.4 / 5)
    hung, died = row.causes
    assert (hung.error.type, hung.error.phase, hung.message) == (
        "WorkerHung",
        "settle",
        "no answer",
    )
    assert (hung.repetitions, hung.tail) == ([3, 5], ["step 3", "died"])
    assert died.repetitions == [6]


@pytest.mark.parametrize("sole", [False, True])
def test_intervals_are_those_the_assertions_use(sole: bool) -> None:
    records = [r.noting(sole=sole) for r in stacking_run() if r.simulator == "mujoco"]
    records = [next(r for r in records if r.ok)] if sole else records
    row, results = only(*records), ResultSet(records, STACKING)
    for metric in STACKING:
        found, expected = row.metrics[metric.name], results.interval(metric.name)
        assert found.mean == pytest.approx(expected.mean)
        constant = expected.method == "constant"  # all values alike: there is no interval
        ends = (None, None) if constant else (expected.low, expected.high)
        assert (found.low, found.high) == ends


@given(
    st.lists(
        st.lists(st.floats(0, 500, allow_subnormal=False), min_size=1, max_size=20),
        min_size=1,
        max_size=6,
    )
)
def test_the_deviation_is_of_all_samples_with_each_repetition_counting_the_same(
    runs: list[list[float]],
) -> None:
    """However often each was sampled; and the mean stands in its interval."""
    uses = [
        {"cpu_percent": {"mean": float(np.mean(run)), "std": float(np.std(run))},
         "samples": len(run)}
        for run in runs
    ]  # fmt: skip
    costs = only(*(record(repetition=k, resources=use) for k, use in enumerate(uses))).costs
    together = np.concatenate(runs)
    weights = np.concatenate([[1 / len(run)] * len(run) for run in runs])
    mean = np.average(together, weights=weights)
    std = np.sqrt(np.average((together - mean) ** 2, weights=weights))
    found = costs["cpu"]
    assert math.isclose(found.mean, mean, abs_tol=1e-9)
    assert math.isclose(found.std, std, rel_tol=1e-9, abs_tol=1e-6)
    assert found.low is None or found.low <= found.mean <= (found.high or 0.0)
    assert costs["ram"] is None


def use(cpu: float, memory: float, samples: int, **peak: float) -> dict[str, Any]:
    ram = {"mean": memory, "std": 0.0, **peak}
    return {"cpu_percent": {"mean": cpu, "std": 0.0}, "rss_mb": ram, "samples": samples}


def test_phases_are_pooled_each_by_itself_and_a_peak_is_the_largest() -> None:
    found = pooled_by_phase(
        [
            {"phases": {"load": use(50.0, 100.0, 1), "pick": use(90.0, 200.0, 10)}},
            {"phases": {"load": use(80.0, 130.0, 2), "never": use(80.0, 130.0, 0)}},
            {},
        ]
    )
    assert list(found) == ["load", "pick"]
    cpu, memory = found["load"]
    assert (cpu.mean, memory.mean, cpu.std, memory.std) == pytest.approx((65, 115, 15, 15))
    peaks = pooled([use(50.0, 100.0, 3, peak=peak) for peak in (120.0, 180.0, 150.0)], "ram")
    assert peaks.peak == 180.0


@given(st.lists(st.lists(st.sampled_from("abcdef"), unique=True)))
def test_the_order_has_every_name_once_and_keeps_the_first_sequence(names: list[list[str]]) -> None:
    order = merged_order(names)
    assert sorted(order) == sorted({name for part in names for name in part})
    first = names[0] if names else []
    assert [name for name in order if name in first] == first
    late = merged_order([["pick", "settle"], ["load", "pick", "retreat"]])
    assert late == ["load", "pick", "retreat", "settle"]


def test_metrics_that_no_repetition_has_are_none_and_undeclared_ones_are_values() -> None:
    row = only(record(task="throwing", metrics={"moved": 0.5, "landing_x": None}))
    assert row.metrics["landing_x"] is row.metrics["hit"] is None
    (summary,) = summarise([record(task="pouring", metrics={"spilled": 3.0})], METRICS)
    assert summary.metrics == (Metric("spilled", "spilled", better=None, study=True),)
    assert not summary.described


def test_rows_carry_what_a_reader_must_know() -> None:
    row = only(record("pybullet", contended=True), record("pybullet", 2, reused_worker=True))
    assert row.deviations == ("rolling friction is not modelled",)
    assert len(row.notes) == 2


def test_a_tasks_own_reasons_are_counted_whatever_their_numbers() -> None:
    runs = [
        record(repetition=1, reasons=("cube_07 slipped at 3.2 s", "it never left the hand")),
        record(repetition=2, reasons=("cube_11 slipped at 0.5 s",)),
    ]
    (found,) = summarise(runs, METRICS)
    table = texts(tables.reasons(found))
    assert table["reason"] == ["cube_# slipped at # s", "it never left the hand"]
    assert table["count"] == ["2", "1"]


@pytest.mark.parametrize(
    ("value", "digits", "shown"),
    [(99.7, 2, "100"), (0.0475, 2, "0.048"), (161.2, 2, "161"), (1.0, 3, "1.00"), (0.0, 2, "0")],
)
def test_digits(value: float, digits: int, shown: str) -> None:
    assert number(value, digits) == shown


@given(st.floats(1e-12, 1e12) | st.floats(-1e12, -1e-12), st.integers(1, 5))
def test_any_number_is_its_own_and_never_a_power_of_ten(value: float, digits: int) -> None:
    shown = number(value, digits)
    assert "e" not in shown
    assert math.isclose(float(shown), value, rel_tol=0.51 * 10 ** (1 - digits))


@pytest.mark.parametrize(
    ("value", "metric", "shown"),
    [
        (-2.2e-16, LATE, "0"),
        (0.0000009, LATE, "0"),
        (0.0008, LATE, "0.0008"),
        (0.003, LATE, "0.003"),
        (2.0, CUBES, "2"),
        (0.0001, CUBES, "0.0001"),  # counts have no resolution: this is a mean of many
        (0.667, SHARE, "67"),
        (0.9967, SHARE, "99.7"),  # not all of them
        (0.99999, SHARE, "99.9"),
        (0.0001, SHARE, "0.1"),
        (1.0, SHARE, "100"),
        (0.0, SHARE, "0"),
    ],
)
def test_what_is_far_below_the_resolution_is_nothing_and_nearly_all_is_not_all(
    value: float, metric: Metric, shown: str
) -> None:
    assert metric_value(value, metric) == shown


@pytest.mark.parametrize("yes", [0, 3, 20])
def test_yes_or_no_is_told_by_how_many_said_yes(yes: int) -> None:
    hit = Metric("hit", "hit", kind="yes_no")
    found = spread([1.0] * yes + [0.0] * (20 - yes), hit)
    lines = [f"{yes} of 20", f"{5 * yes} {interval(found, hit)}"]
    assert cells.spread(found, hit) == cells.mean_first(found, hit)
    assert (cells.spread(found, hit).lines, cells.spread(found, hit).sort) == (lines, yes / 20)


def test_an_end_far_nearer_to_0_than_to_the_other_is_0() -> None:
    found = spread([0.0] * 19 + [1.0], Metric("picks", "picks", least=0))
    assert 0 < found.low < 1e-4
    assert interval(found, CUBES).startswith("[0, 0.")


def test_a_value_below_the_least_is_shown_without_an_interval() -> None:
    found = spread([0.0, 1.0, 2.0, 1.0, -1.0], Metric("picks", "picks", least=0))
    assert (found.min, found.low, found.high) == (-1.0, None, None)


def test_the_model_loads_no_library_of_statistics_no_planner_and_nothing_that_draws() -> None:
    code = """if True:
        import sys
        import pytest_simbench.report.model.report
        heavy = {"scipy", "pinocchio", "ompl", "coal", "ruckig", "rich", "matplotlib", "jinja2"}
        print(sorted(heavy & set(sys.modules)))
        import pytest_simbench.report.files, pytest_simbench.report.terminal.run
        print(sorted((heavy - {"rich"}) & set(sys.modules)))
        """
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["[]", "[]"]
