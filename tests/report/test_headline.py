"""The three sentences of a run: right, and no more certain than the tests between the rows."""

from __future__ import annotations

from dataclasses import replace

from pytest_simbench.records.metrics import Metric
from pytest_simbench.report.model.headline import headline
from pytest_simbench.report.model.matrix import with_differences
from pytest_simbench.report.model.summary import TaskSummary, summarise

from .samples import METRICS, record, stacking_run, throwing_run
from .test_answer import SCORE, task


def test_sample_runs() -> None:
    records = [*stacking_run(), *throwing_run()]
    assert headline(with_differences(summarise(records, METRICS), records)) == [
        "2 simulators did stacking and throwing: 80 repetitions, 3 crashed (pybullet 3).",
        "Outcome: stacking, placed and at the end: mujoco ahead (behind: pybullet); "
        "throwing, moved: a difference needs at least 6 pairs that differ; so far 1.",
        "Cost: CPU s per simulated s, stacking and throwing: not compared; RAM, stacking and "
        "throwing: a difference needs at least 6 pairs that differ; so far none.",
    ]


def test_without_wins_nobody_is_ahead() -> None:
    found = headline([task({"a": 0.1, "b": 0.9})])
    assert found[1] == "Outcome: t, score: not told apart."


def test_many_are_counted_not_named() -> None:
    means = dict.fromkeys("abcdefg", 0.1) | {"x": 0.9}
    found = headline([task(means, tuple(f"x>{name}" for name in "abcdefg"))])
    assert found[1] == "Outcome: t, score: x ahead (behind: 7 others)."


def test_who_beats_and_is_beaten_is_behind() -> None:
    found = headline([task({"a": 0.1, "b": 0.5, "c": 0.9}, ("c>b", "b>a", "c>a"))])
    assert found[1] == "Outcome: t, score: c ahead (behind: a and b)."


def test_a_single_simulator_is_told_with_its_value() -> None:
    records = [record(repetition=k, metrics={"placed": 1.0, "at_end": 0.8}) for k in range(10)]
    found = headline(summarise(records, METRICS))
    assert found[0] == "mujoco did stacking: 10 repetitions, none crashed."
    assert found[1].startswith("Outcome: stacking, placed: 100 % [")
    assert found[2] == "Cost: CPU s per simulated s: 0.048; RAM: 150 MB."


def test_few_repetitions_are_not_compared() -> None:
    (_, outcome, _) = headline(
        summarise([record(name, metrics={"placed": 1.0, "at_end": 1.0}) for name in "ab"], METRICS)
    )
    assert outcome == "Outcome: stacking, placed and at the end: not compared."


def test_interrupted_repetitions_are_told() -> None:
    records = [record(metrics={"placed": 1.0}), record(repetition=2, status="interrupted")]
    assert headline(summarise(records, METRICS))[0] == (
        "mujoco did stacking: 1 repetition, none crashed, 1 cut short."
    )


def test_a_task_without_metrics_of_the_study_names_its_first_two() -> None:
    metrics = tuple(Metric(name, name, "m", "lower") for name in ("one", "two", "three"))
    found = task({"a": 0.1, "b": 0.9})
    spread = found.rows[0].metrics[SCORE.name]
    rows = tuple(replace(row, metrics=dict.fromkeys(("one", "two"), spread)) for row in found.rows)
    assert headline([TaskSummary("t", metrics, rows)])[1] == (
        "Outcome: t, one and two: not compared."
    )


def test_of_nothing_nothing_is_told() -> None:
    assert headline([]) == []
