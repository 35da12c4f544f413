"""The text of `--sim-compare-fail`."""

from __future__ import annotations

import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.measure.limits import (
    Limit,
    LimitError,
    check_gate,
    check_threshold,
    parse_limits,
)
from pytest_simbench.records.metrics import COSTS, CRASHED, Metric, UnknownMetric
from tests.records.build import METRICS

PLACED, _, ERROR, _ = METRICS
RTF = COSTS[0]


def test_an_amount_is_relative_or_in_the_metrics_unit() -> None:
    assert parse_limits("placed:5%, ram:10%,rtf:20%,landing_error:0.01", METRICS) == (
        Limit("placed", 0.05, True),
        Limit("ram", 0.1, True),
        Limit("rtf", 0.2, True),
        Limit("landing_error", 0.01, False),
    )


@pytest.mark.parametrize("name", ["crashed", "failures"])
def test_crashes_are_a_metric_also_by_its_name_of_before(name: str) -> None:
    assert parse_limits(f"{name}:10%", ()) == (Limit("crashed", 0.1, True),)
    own = Metric("failures", "failures of the task", better="lower")
    assert parse_limits("failures:10%,crashed:5%", (own,))[0] == Limit("failures", 0.1, True)


NO_LIMIT = "is not a limit like placed:5% or landing_error:0.01"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        *((text, NO_LIMIT) for text in ("", "placed", "placed=5%", "placed:-5%", "placed:5%,",
                                        "placed:x", "a:1e3")),
        ("landing_x:5%", "landing_x can be neither better nor worse"),
        ("ram:5%,ram:6%", "ram has two limits"),
    ],
)  # fmt: skip
def test_what_is_no_limit_is_told(text: str, said: str) -> None:
    with pytest.raises(LimitError, match=re.escape(said)):
        parse_limits(text, METRICS)


def test_an_unknown_metric_lists_the_valid_names() -> None:
    with pytest.raises(UnknownMetric) as caught:
        parse_limits("plaecd:5%", METRICS)
    assert "did you mean 'placed'?" in str(caught.value)
    assert "crashed" in str(caught.value)
    assert "landing_x" not in str(caught.value)


@pytest.mark.parametrize(
    ("limit", "metric", "before", "after", "loss", "text"),
    [
        (Limit("placed", 0.05, True), PLACED, 0.9, 0.8, 0.1, "10 points"),
        (Limit("crashed", 0.05, True), CRASHED, 0.1, 0.3, 0.2, "20 points"),
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


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("placed:5", "placed lies between 0 and 100 %; did you mean placed:5%?"),
        ("placed:1", "placed lies between 0 and 100 %; did you mean placed:1%?"),
        ("hit:100%", "hit lies between 0 and 100 %"),
        ("placed:150%", "placed lies between 0 and 100 %"),
        ("crashed:2", "crashed lies between 0 and 100 %; did you mean crashed:2%?"),
        ("rtf:200%", "rtf cannot fall by more than 100 %"),
        ("rtf:100%", "rtf cannot fall by more than 100 %"),
    ],
)
def test_a_limit_that_nothing_can_exceed_is_refused(text: str, reason: str) -> None:
    with pytest.raises(LimitError) as caught:
        parse_limits(text, METRICS)
    assert str(caught.value) == f"{text} can never be exceeded: {reason}"


@pytest.mark.parametrize(
    "text", ["placed:99%", "placed:0.05", "placed:0%", "rtf:99%", "rtf:5", "ram:200%", "ram:500"]
)
def test_a_limit_that_something_can_exceed_is_taken(text: str) -> None:
    (limit,) = parse_limits(text, METRICS)
    metric = next(m for m in (*METRICS, *COSTS) if m.name == limit.metric)
    worst = {"higher": (1.0, 0.0), "lower": (1.0, 1000.0)}[metric.better or ""]
    if not metric.bounded and not limit.percent:
        worst = (worst[0] * 100, worst[1])
    assert limit.loss(metric, *worst) > limit.amount


@pytest.mark.parametrize(
    ("metric", "value", "message"),
    [
        (PLACED, 1.5, "placed is a share, so its threshold lies between 0 and 1, not at 1.5; did"),
        (PLACED, 90.0, "between 0 and 1, not at 90; did you mean 0.9?"),
        (PLACED, 900.0, "not at 900$"),
        (PLACED, -1.0, "not at -1$"),
        (PLACED, math.nan, "a threshold of placed is a finite number, not nan"),
        (ERROR, True, "a threshold of landing_error is a finite number, not True"),
        (PLACED, "x", "a threshold of placed is a finite number, not 'x'"),
        (ERROR, math.inf, "a threshold of landing_error is a finite number, not inf"),
    ],
)
def test_a_threshold_that_a_metric_cannot_reach_is_refused(
    metric: Metric, value: float, message: str
) -> None:
    for check in (check_threshold, check_gate):
        with pytest.raises(LimitError, match=message):
            check(metric, value)


def test_thresholds_at_the_ends_are_claims_but_no_gates() -> None:
    for metric, value, always in ((PLACED, 0.0, "at least 0"), (CRASHED, 1.0, "at most 1")):
        check_threshold(metric, value)
        with pytest.raises(LimitError) as caught:
            check_gate(metric, value)
        assert str(caught.value) == (
            f"{metric.name} is always {always}, so that this threshold can never fail"
        )
    for metric, value in ((RTF, 0.0), (RTF, -3.0)):
        with pytest.raises(LimitError, match="rtf is always at least"):
            check_gate(metric, value)
    with pytest.raises(
        LimitError, match="^ram is never below 0, so a threshold of -1 always fails$"
    ):
        check_gate(next(cost for cost in COSTS if cost.name == "ram"), -1.0)


@pytest.mark.parametrize(
    ("metric", "value"),
    [(PLACED, 0.01), (PLACED, 1.0), (CRASHED, 0.0), (CRASHED, 0.99), (RTF, 0.1), (ERROR, 0.0)],
)
def test_thresholds_that_can_fail_are_taken(metric: Metric, value: float) -> None:
    check_gate(metric, value)
