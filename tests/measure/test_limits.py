"""The text of `--sim-compare-fail`."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.measure.limits import FAILURES, Limit, LimitError, parse_limits
from pytest_simbench.measure.metrics import COSTS, Metric, UnknownMetric

from .build import METRICS

PLACED, _, ERROR, _ = METRICS
RTF = COSTS[0]


def test_the_readmes_example() -> None:
    assert parse_limits("placed:5%, ram:10%,rtf:20%", METRICS) == (
        Limit("placed", 0.05, True),
        Limit("ram", 0.1, True),
        Limit("rtf", 0.2, True),
    )


def test_an_amount_without_percent_is_in_the_metrics_unit() -> None:
    assert parse_limits("landing_error:0.01", METRICS) == (Limit("landing_error", 0.01, False),)


def test_failures_are_a_metric() -> None:
    assert parse_limits("failures:10%", ()) == (Limit("failures", 0.1, True),)


@pytest.mark.parametrize(
    "text", ["", "placed", "placed=5%", "placed:-5%", "placed:5%,", "placed:x", "a:1e3"]
)
def test_what_is_no_limit_is_quoted_with_an_example(text: str) -> None:
    with pytest.raises(LimitError, match=r"is not a limit like placed:5% or landing_error:0\.01"):
        parse_limits(text, METRICS)


def test_an_unknown_metric_lists_the_valid_names() -> None:
    with pytest.raises(UnknownMetric) as caught:
        parse_limits("plaecd:5%", METRICS)
    assert "did you mean 'placed'?" in str(caught.value)
    assert "failures" in str(caught.value)
    assert "landing_x" not in str(caught.value)


def test_a_metric_without_a_better_side_has_no_limit() -> None:
    with pytest.raises(LimitError, match="landing_x can be neither better nor worse"):
        parse_limits("landing_x:5%", METRICS)


def test_two_limits_of_one_metric_are_refused() -> None:
    with pytest.raises(LimitError, match="ram has two limits"):
        parse_limits("ram:5%,ram:6%", METRICS)


@pytest.mark.parametrize(
    ("limit", "metric", "before", "after", "loss", "text"),
    [
        (Limit("placed", 0.05, True), PLACED, 0.9, 0.8, 0.1, "10 points"),
        (Limit("failures", 0.05, True), FAILURES, 0.1, 0.3, 0.2, "20 points"),
        (Limit("rtf", 0.2, True), RTF, 10, 7, 0.3, "30 %"),
        (Limit("rtf", 0.2, True), RTF, 10, 12, -0.2, "-20 %"),
        (Limit("landing_error", 0.01, False), ERROR, 0.01, 0.03, 0.02, "0.02 m"),
        (Limit("landing_error", 0.1, True), ERROR, 0.0, 0.03, math.inf, "inf %"),
        (Limit("landing_error", 0.1, True), ERROR, 0.0, 0.0, 0.0, "0 %"),
    ],
)
def test_a_loss_is_in_the_terms_of_its_limit(
    limit: Limit, metric: Metric, before: float, after: float, loss: float, text: str
) -> None:
    assert limit.loss(metric, before, after) == pytest.approx(loss)
    assert limit.describe(metric, loss) == text


@given(st.floats(0.1, 10), st.floats(0.1, 10), st.booleans())
def test_worse_one_way_is_better_the_other(before: float, after: float, percent: bool) -> None:
    limit = Limit("rtf", 0.1, percent)
    forth, back = limit.loss(RTF, before, after), limit.loss(RTF, after, before)
    assert (forth > 0) == (after < before)
    assert (forth > 0) == (back < 0)
