"""From records to rows: what is counted, what is left out, and how samples are pooled."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.measure.results import ResultSet
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.record import Record
from pytest_simbench.report.model import tables as columns
from pytest_simbench.report.model.summary import summarise

from .samples import METRICS, REFERENCES, STACKING, failed, record, stacking_run, throwing_run


def test_one_summary_per_task_and_one_row_per_simulator_and_mode() -> None:
    records = throwing_run() + stacking_run("gui") + stacking_run()
    summaries = summarise(reversed(records), METRICS, REFERENCES)
    assert [(s.task, [row.label for row in s.rows]) for s in summaries] == [
        (
            "stacking",
            [
                "mujoco headless tuned",
                "mujoco gui tuned",
                "pybullet headless tuned",
                "pybullet gui tuned",
            ],
        ),
        ("throwing", ["mujoco headless tuned", "pybullet headless tuned"]),
    ]
    assert [m.name for m in summaries[0].study] == ["placed", "at_end"]
    assert summaries[1].references == REFERENCES["throwing"]


def test_failed_repetitions_count_and_interrupted_ones_are_left_out() -> None:
    records = [
        record(repetition=1, metrics={"placed": 0.8}),
        record(repetition=2, metrics={"placed": 0.6}),
        failed("WorkerHung", "settle", "no\nanswer", repetition=3, metrics={"placed": 0.0}),
        failed("WorkerHung", "settle", "none", repetition=5),
        failed("WorkerDied", "pick", "gone", repetition=6),
        record(repetition=7, status="interrupted", metrics={"placed": 0.0}),
    ]
    (row,) = summarise(records, METRICS)[0].rows
    assert (row.finished, row.failed, row.interrupted, row.attempts) == (2, 3, 1, 5)
    placed = row.metrics["placed"]
    assert placed is not None
    assert (placed.count, placed.min, placed.max) == (5, 0.0, 0.8)  # a crash is the worst
    assert placed.mean == pytest.approx(1.4 / 5)
    hung, died = row.causes
    assert (hung.type, hung.phase, hung.message) == ("WorkerHung", "settle", "no answer")
    assert (hung.repetitions, hung.seeds, hung.last_line) == ((3, 5), (1003, 1005), "died")
    assert died.repetitions == (6,)


def test_intervals_are_those_the_assertions_use() -> None:
    records = [r for r in stacking_run() if r.simulator == "mujoco"]
    (row,) = summarise(records, METRICS)[0].rows
    results = ResultSet(records, STACKING)
    for metric in STACKING:
        found, expected = row.metrics[metric.name], results.interval(metric.name)
        assert found is not None
        assert found.mean == pytest.approx(expected.mean)
        if expected.method == "constant":  # all values alike: the cell shows no interval
            assert (found.low, found.high) == (None, None)
        else:
            assert (found.low, found.high) == (expected.low, expected.high)


def test_costs_come_from_the_stepping_clocks() -> None:
    (row,) = summarise([record()], METRICS)[0].rows
    assert row.real_time_factor is not None
    assert row.cpu_cost is not None
    assert row.real_time_factor.mean == 20.0  # 160 simulated seconds in 8
    assert row.cpu_cost.mean == 7.6 / 160


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
    records = [
        record(
            repetition=number,
            resources={
                "cpu_percent": {"mean": float(np.mean(run)), "std": float(np.std(run))},
                "samples": len(run),
            },
        )
        for number, run in enumerate(runs)
    ]
    (row,) = summarise(records, METRICS)[0].rows
    together = np.concatenate(runs)
    weights = np.concatenate([[1 / len(run)] * len(run) for run in runs])
    mean = np.average(together, weights=weights)
    std = np.sqrt(np.average((together - mean) ** 2, weights=weights))
    assert row.cpu_percent is not None
    assert math.isclose(row.cpu_percent.mean, mean, abs_tol=1e-9)
    assert math.isclose(row.cpu_percent.std, std, rel_tol=1e-9, abs_tol=1e-6)
    assert row.rss_mb is None


def test_metrics_that_no_repetition_has_are_none() -> None:
    records = [record(task="throwing", metrics={"moved": 0.5, "landing_x": None})]
    (row,) = summarise(records, METRICS)[0].rows
    assert row.metrics["landing_x"] is None
    assert row.metrics["hit"] is None
    moved = row.metrics["moved"]
    assert moved is not None
    assert moved.low is None or moved.low < moved.mean


def test_a_task_nobody_declared_shows_its_metrics_as_values() -> None:
    (summary,) = summarise([record(task="pouring", metrics={"spilled": 3.0})], METRICS)
    assert summary.metrics == (Metric("spilled", "spilled", better=None, study=True),)


def test_two_tests_of_one_task_are_told_apart_by_name() -> None:
    records = [record(test="test_a[mujoco-headless]"), record(test="test_b[mujoco-headless]")]
    labels = [row.label for row in summarise(records, METRICS)[0].rows]
    assert labels == ["mujoco headless tuned test_a", "mujoco headless tuned test_b"]


def test_rows_carry_what_a_reader_must_know() -> None:
    records = [record("pybullet", contended=True), record("pybullet", 2, reused_worker=True)]
    (row,) = summarise(records, METRICS)[0].rows
    assert row.deviations == ("rolling friction is not modelled",)
    assert len(row.notes) == 2


def test_no_records_no_summaries() -> None:
    none: list[Record] = []
    assert summarise(none, METRICS) == []


def test_a_tasks_own_reasons_are_counted_whatever_their_numbers() -> None:
    runs = [
        record(repetition=1, reasons=("cube_07 slipped at 3.2 s", "it never left the hand")),
        record(repetition=2, reasons=("cube_11 slipped at 0.5 s",)),
    ]
    (found,) = summarise(runs, METRICS)
    assert found.rows[0].reasons == (
        ("cube_# slipped at # s", 2),
        ("it never left the hand", 1),
    )
    tables = dict(columns.details(found))
    assert tables["why the task fell short"][1].cells == [["2"], ["1"]]
