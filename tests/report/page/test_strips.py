"""Strip plots: a dot for each repetition, where its value says, and none on top of another."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.records.record import Record
from pytest_simbench.records.series import series
from pytest_simbench.report.model.summary import summarise
from pytest_simbench.report.page.strips import HEIGHT, LEFT, LOST, MOST, RIGHT, Strip, strips
from tests.report.samples import METRICS, REFERENCES, record, stacking_run, throwing_run


def plots(records: list[Record]) -> dict[str, Strip]:
    """By title; a record's number is its repetition."""
    (summary,) = summarise(records, METRICS, REFERENCES)
    rows = [row.records for row in series(records)]
    return {plot.title: plot for plot in strips(summary, rows, lambda r: r.repetition)}


def test_every_repetition_of_every_row_has_a_mark() -> None:
    for title, plot in plots(stacking_run()).items():
        assert [line.label for line in plot.lines] == ["mujoco", "pybullet"]
        for line in plot.lines:
            marks = sorted(dot.number for dot in (*line.dots, *line.lost))
            assert marks == list(range(1, 21)), title
        assert sorted(dot.number for dot in plot.lines[1].lost) == [3, 8, 9]


def test_shares_lie_between_nothing_and_all() -> None:
    plot = plots(stacking_run())["placed %"]
    assert plot.study
    assert plot.ticks == [(LEFT, "0"), *plot.ticks[1:4], (RIGHT, "100")]
    first = next(dot for dot in plot.lines[0].dots if dot.number == 5)
    assert first.value == "93 %"
    assert first.x == pytest.approx(LEFT + (RIGHT - LEFT) * 14 / 15, abs=0.01)
    line = plot.lines[0]
    assert line.low is not None
    assert line.mean is not None
    assert line.high is not None
    assert line.low < line.mean < line.high <= RIGHT


def test_values_keep_their_order_and_the_reference_has_its_place() -> None:
    plot = plots(throwing_run())["landing x m"]
    assert plot.reference is not None
    assert max(dot.x for dot in plot.lines[1].dots) < plot.reference
    assert min(dot.x for dot in plot.lines[0].dots) > plot.reference
    assert not plot.study
    assert all(LEFT <= dot.x <= RIGHT for line in plot.lines for dot in line.dots)
    assert [dot.x for dot in plot.lines[1].lost] == [LOST]


def test_costs_that_differ_widely_are_logarithmic() -> None:
    def made(most: float) -> Strip:
        records = [
            record(repetition=k + 1, stepping={"cpu": cpu, "simulated": 1.0, "wall": 1.0})
            for k, cpu in enumerate((0.01, 0.1, most))
        ]
        return plots(records)["CPU s per simulated s"]

    assert not made(0.15).logarithmic
    plot = made(1.0)
    assert plot.logarithmic
    x = [dot.x for dot in sorted(plot.lines[0].dots, key=lambda dot: dot.number)]
    assert x[1] - x[0] == pytest.approx(x[2] - x[1], abs=0.02)


def test_a_metric_that_nothing_has_is_left_out() -> None:
    assert "placed %" not in plots([record(metrics={"at_end": 1.0})])


def test_of_very_many_some_are_drawn_and_all_counted() -> None:
    """The ends are among them, mean and interval are of all, and the line says so."""
    records = [record(repetition=k, metrics={"placed": k % 15 / 15}) for k in range(1, 1000)]
    records[500] = record(repetition=501, metrics={"placed": 1.0})
    (line,) = plots(records)["placed %"].lines
    assert MOST - 2 <= len(line.dots) <= MOST
    assert line.left_out == f"{len(line.dots)} of 999 repetitions drawn"
    assert 501 in {dot.number for dot in line.dots}
    (few,) = plots(records[:MOST])["placed %"].lines
    assert (len(few.dots), few.left_out) == (MOST, "")
    shares = [r.metrics["placed"] or 0.0 for r in records]
    assert line.mean == pytest.approx(LEFT + (RIGHT - LEFT) * sum(shares) / 999, abs=0.01)


@given(st.lists(st.sampled_from([0.0, 0.2, 0.2001, 0.5, 1.0]), min_size=1, max_size=40))
def test_no_two_dots_lie_on_each_other(values: list[float]) -> None:
    records = [record(repetition=k, metrics={"placed": v}) for k, v in enumerate(values)]
    (line,) = plots(records)["placed %"].lines
    assert len(line.dots) == len(values)
    assert all(0 <= dot.y <= HEIGHT for dot in line.dots)
    for a, b in itertools.combinations(line.dots, 2):
        assert (a.x, a.aside, a.y) != (b.x, b.aside, b.y)
        if abs(a.x - b.x) < 0.1:
            assert abs(a.aside - b.aside) >= 6 or abs(a.y - b.y) >= 6
