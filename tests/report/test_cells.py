"""Numbers in cells are read by people: no powers of ten, and no rounding noise."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.records.metrics import Metric
from pytest_simbench.report.model import cells
from pytest_simbench.report.model.cells import interval, metric_value, number
from pytest_simbench.report.model.pooling import spread
from pytest_simbench.report.page import cells as page_cells

LATE = Metric("late", "late", unit="s")
CUBES = Metric("moved", "moved", unit="cubes")
SHARE = Metric("placed", "placed", kind="share", of=15)


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
    ],
)
def test_what_is_far_below_the_resolution_is_nothing(
    value: float, metric: Metric, shown: str
) -> None:
    assert metric_value(value, metric) == shown


@pytest.mark.parametrize("yes", [0, 3, 20])
def test_yes_or_no_is_told_by_how_many_said_yes(yes: int) -> None:
    hit = Metric("hit", "hit", kind="yes_no")
    found = spread([1.0] * yes + [0.0] * (20 - yes), hit)
    assert found is not None
    lines = [f"{yes} of 20", f"{5 * yes} {interval(found, hit)}"]
    assert cells.spread(found, hit) == lines
    assert page_cells._spread(found, hit) == page_cells.Cell(lines, yes / 20)


def test_an_end_far_nearer_to_0_than_to_the_other_is_0() -> None:
    found = spread([0.0] * 19 + [1.0], Metric("picks", "picks", least=0))
    assert found is not None
    assert found.low is not None
    assert 0 < found.low < 1e-4
    assert interval(found, CUBES).startswith("[0, 0.")


def test_a_value_below_the_least_is_shown_without_an_interval() -> None:
    found = spread([0.0, 1.0, 2.0, 1.0, -1.0], Metric("picks", "picks", least=0))
    assert found is not None
    assert (found.min, found.low, found.high) == (-1.0, None, None)
