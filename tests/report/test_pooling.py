"""Samples of several repetitions as one, by phase; and the order of phases."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.report.markdown.run import render_task
from pytest_simbench.report.model import tables as columns
from pytest_simbench.report.model.pooling import merged_order, pooled, pooled_by_phase
from pytest_simbench.report.model.summary import summarise
from pytest_simbench.report.terminal.run import render_run
from tests.report.samples import METRICS, record


def use(cpu: float, memory: float, samples: int) -> dict[str, Any]:
    return {
        "cpu_percent": {"mean": cpu, "std": 0.0},
        "rss_mb": {"mean": memory, "std": 0.0},
        "samples": samples,
    }


def test_each_repetition_counts_the_same_however_often_it_was_sampled() -> None:
    found = pooled_by_phase(
        [
            {"phases": {"load": use(50.0, 100.0, 1), "pick": use(90.0, 200.0, 10)}},
            {"phases": {"load": use(80.0, 130.0, 2)}},
            {},
        ]
    )
    assert list(found) == ["load", "pick"]
    cpu, memory = found["load"]
    assert (cpu.mean, memory.mean) == pytest.approx((65.0, 115.0))
    assert (cpu.std, memory.std) == pytest.approx((15.0, 15.0))
    assert found["pick"][0].mean == 90.0


def test_the_peak_of_several_is_the_largest() -> None:
    uses = [use(50.0, 100.0, 3) for _ in range(3)]
    for told, peak in zip(uses, (120.0, 180.0, 150.0), strict=True):
        told["rss_mb"]["peak"] = peak
    found = pooled(uses, "rss_mb")
    assert found is not None
    assert found.peak == 180.0


@given(st.lists(st.tuples(st.floats(0, 400), st.integers(1, 5000)), min_size=5, max_size=20))
def test_a_mean_stands_in_its_interval(uses: list[tuple[float, int]]) -> None:
    """Also where short repetitions are the busy ones: DART's CPU was 35 +- 27 [38, 59]."""
    found = pooled([use(cpu, 100.0, samples) for cpu, samples in uses], "cpu_percent")
    assert found is not None
    if found.low is not None and found.high is not None:
        assert found.low <= found.mean <= found.high
    assert found.mean == pytest.approx(sum(cpu for cpu, _ in uses) / len(uses))


def test_a_phase_that_was_never_sampled_is_left_out() -> None:
    assert pooled_by_phase([{"phases": {"load": use(50.0, 100.0, 0)}}]) == {}


def test_a_late_phase_comes_after_the_one_that_it_follows() -> None:
    assert merged_order([["pick", "settle"], ["load", "pick", "retreat"]]) == [
        "load",
        "pick",
        "retreat",
        "settle",
    ]


@given(st.lists(st.lists(st.sampled_from("abcdef"), unique=True)))
def test_the_order_has_every_name_once_and_keeps_the_first_sequence(names: list[list[str]]) -> None:
    order = merged_order(names)
    assert sorted(order) == sorted({name for part in names for name in part})
    first = names[0] if names else []
    assert [name for name in order if name in first] == first


def test_the_written_report_has_the_table_and_the_terminal_has_not() -> None:
    phases = {"phases": {"pick": use(90.0, 200.0, 10)}, **use(90.0, 200.0, 10)}
    other = {**phases, "phases": {}}
    found = summarise(
        [record(resources=phases), record(simulator="other", resources=other)], METRICS
    )
    written = render_task(found[0])
    assert "| 90 % 200 MB |" in written
    assert columns.BY_PHASE in written
    assert columns.BY_PHASE not in "\n".join(render_run(found, 100))
