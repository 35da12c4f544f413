"""The declaration of a metric."""

from __future__ import annotations

import re
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.records.metrics import COSTS, Metric, UnknownMetric, significant


@pytest.mark.parametrize(
    ("metric", "value", "text"),
    [
        (Metric("placed", "placed", kind="share", of=15), 14 / 15, "93.33 %"),
        (Metric("hit", "hit", kind="yes_no"), 1.0, "100 %"),
        (Metric("landing_x", "landing", "m"), 1.3521, "1.35 m"),
        (Metric("rtf", "real-time factor"), 17.53, "17.5"),
    ],
)
def test_values_read_as_a_user_expects(metric: Metric, value: float, text: str) -> None:
    assert metric.format(value) == text


@pytest.mark.parametrize(
    ("before", "after", "differ"),
    [(0.0125, 0.0134, False), (0.0125, 0.0136, True), (5.121, 5.124, False), (-0.01, 0.01, True)],
)
def test_two_values_differ_by_a_millimetre_that_is_seen(
    before: float, after: float, differ: bool
) -> None:
    metric = Metric("x", "x", "m")
    assert metric.differs(before, after) == metric.differs(after, before) == differ


def test_yes_or_no_is_nothing_in_between() -> None:
    metric = Metric("hit", "hit", kind="yes_no")
    assert [metric.holds(value) for value in (0.0, 0.6, 1.0)] == [True, False, True]


def test_a_crash_counts_with_the_worst_there_is() -> None:
    for better, worst in (("higher", 0.0), ("lower", 1.0), (None, None)):
        assert Metric("x", "x", better=better, kind="yes_no").crashed == worst
        assert Metric("x", "x", better=better).crashed is None


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"kind": "part"}, "metric 'x': kind='part'; choose from 'share', 'yes_no', 'value'"),
        ({"better": "more"}, "metric 'x': better='more'; choose from 'higher', 'lower', None"),
        ({"kind": "share"}, "metric 'x' is a share: say of how many things (of=...)"),
    ],
)
def test_what_is_no_metric_is_told(given: dict[str, Any], told: str) -> None:
    with pytest.raises(ValueError, match=re.escape(told)):
        Metric("x", "x", **given)


def test_what_a_metric_can_be_and_by_how_much_it_differs() -> None:
    share, hit, count = (
        Metric("a", "a", kind="share", of=3),
        Metric("b", "b", kind="yes_no"),
        COSTS[0],
    )
    assert [share.holds(value) for value in (-0.1, 0.0, 0.5, 1.0, 1.1)] == [False] + [True] * 3 + [
        False
    ]
    assert [count.holds(value) for value in (-0.1, 0.0)] == [False, True]
    assert Metric("x", "x").holds(-9.0)
    free = [Metric("x", "x", unit) for unit in ("m/s", "m/s^2")]
    assert [m.smallest_difference for m in (share, hit, *free)] == [0.0, 0.0, 0.005, 0.0]
    assert Metric("x", "x", "m", resolution=0.2).smallest_difference == 0.2


def test_an_unknown_name_lists_the_valid_ones_and_the_nearest() -> None:
    error = UnknownMetric("placd", ["moved", "placed"])
    assert (error.name, error.valid) == ("placd", ["moved", "placed"])
    assert str(error) == (
        "no metric is named 'placd'; did you mean 'placed'? valid names: moved, placed"
    )


def test_costs_have_distinct_names_and_all_say_what_they_are() -> None:
    assert len({metric.name for metric in COSTS}) == len(COSTS)
    assert all(metric.doc and metric.better for metric in COSTS)


@pytest.mark.parametrize(
    ("value", "shown"),
    [(99.7, "99.7"), (999.96, "1000"), (0.00012345, "0.000123"), (-1.996, "-2"), (0.0, "0")],
)
def test_significant_digits(value: float, shown: str) -> None:
    assert significant(value) == shown


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_any_number_has_significant_digits(value: float) -> None:
    """Also the largest: rounded up to a few digits it is no double any more."""
    shown = significant(value)
    assert "e" not in shown
    assert float(shown) == pytest.approx(value, rel=0.006, abs=0.0)


def test_the_largest_number_has_significant_digits() -> None:
    assert len(significant(1.7975e308, 4)) == 309
