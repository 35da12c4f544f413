"""The result set: what is counted, and every assertion green, red and inconclusive."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace
from typing import Any

import pytest

from pytest_simbench.measure.intervals import interval, proportion
from pytest_simbench.measure.limits import LimitError
from pytest_simbench.measure.results import InconclusiveWarning, ResultSet
from pytest_simbench.measure.verdicts import Bound, Verdict, at_least, at_most
from pytest_simbench.records.metrics import CRASHED, Better, Metric, UnknownMetric
from pytest_simbench.records.record import Failure
from tests.records.build import METRICS, failed, record, records


def placed(*values: float, also: int = 0) -> ResultSet:
    """A result set with these shares, and some failures."""
    made = records("placed", values)
    made += [failed(len(values) + k) for k in range(also)]
    return ResultSet(made, METRICS)


GOOD = [14 / 15, 1.0] * 10
MIXED = [0.8, 1.0] * 10


@pytest.mark.parametrize(
    ("metric", "protocol", "values"),
    [
        ("placed", "fast", [0.5, 0.5, 0.0, 0.0]),
        ("hit", "smoke", [0.5, 0.5, 0.0, 0.0]),
        ("tipped", "fast", [0.5, 0.5, 1.0, 1.0]),  # the worst value there is
        ("landing_error", "fast", [0.5, 0.5]),  # lengths and times have none
        ("landing_x", "fast", [0.5, 0.5]),
        ("sides", "fast", [0.5, 0.5]),  # a share of which neither direction is good
        ("rtf", "fast", [17.5, 17.5]),
        ("placed", "paper", [0.5, 0.5]),  # as the study counts
    ],
)
def test_a_crashed_repetition_counts_with_the_worst_value_that_there_is(
    metric: str, protocol: str, values: list[float]
) -> None:
    metrics = (
        *METRICS,
        Metric("tipped", "tipped", better="lower", kind="yes_no"),
        Metric("sides", "sides", better=None, kind="share", of=2),
    )
    given: dict[str, float | None] = {m.name: 0.5 for m in metrics}
    made = [record(k, metrics=given, protocol=protocol) for k in range(2)]
    made += [replace(failed(k), protocol=protocol) for k in (2, 3)]
    made.append(record(4, status="interrupted", metrics=given))
    result = ResultSet(made, metrics)
    assert result.values(metric) == values
    assert result.by_seed(metric) == {1000 + k: value for k, value in enumerate(values)}
    assert result.interval(metric).n == len(values)
    assert (len(result), len(result.ok), len(result.crashed)) == (5, 2, 2)
    assert result.failures == result.crashed
    assert result.by_seed(CRASHED) == {1000: 0.0, 1001: 0.0, 1002: 1.0, 1003: 1.0}
    others = Metric("others", "of another test of the task", kind="yes_no")
    assert ResultSet(made, (others,)).values("others") == []


@pytest.mark.parametrize(
    ("metric", "protocol", "said"),
    [
        ("placed", "fast", r"placed is 100 % .*, 18 repetitions that finished, 2 crashed\)"),
        ("landing_error", "fast", r"is 1 m .*, 18 repetitions that finished, 2 crashed\)"),
        ("placed", "paper", r"placed is 100 % .*, 18 repetitions that finished, 2 crashed, not "
                            r"counted by --protocol paper\)"),
    ],
)  # fmt: skip
def test_a_message_says_what_became_of_the_crashed(metric: str, protocol: str, said: str) -> None:
    made = [record(k, metrics={metric: 1.0}, protocol=protocol) for k in range(18)]
    made += [replace(failed(k), protocol=protocol) for k in (18, 19)]
    with pytest.raises(AssertionError, match=said):
        ResultSet(made, METRICS).assert_at_most(metric, 0.1)


@pytest.mark.parametrize(
    ("finished", "crashed", "may", "said"),
    [
        (1, 1, 0.0, "1 of 2 repetitions crashed: 1 x WorkerHung in settle .*None may crash"),
        (19, 1, 0.0, "1 of 20 repetitions crashed"),
        (20, 0, 0.0, ""),
        (0, 2, 0.0, "2 of 2 repetitions crashed: 2 x WorkerHung.*No repetition finished"),
        (0, 2, 0.99, "No repetition finished"),
        (0, 2, 1.0, ""),
        (16, 4, 0.05, "4 of 20 repetitions crashed.*95 % bounds 7.1.*above 5 %"),
    ],
)
def test_more_crashes_than_may_fail_whatever_else_is_claimed(
    finished: int, crashed: int, may: float, said: str
) -> None:
    made = placed(*[1.0] * finished, also=crashed)
    if not said:
        return made.check_crashes(may)
    with pytest.raises(AssertionError, match=said):
        made.check_crashes(may)
    ((metric, judgement),) = made.judged  # the table of claims shows it
    assert (metric.name, judgement.verdict) == ("crashed", "refuted")


def test_that_none_crashed_stands_in_the_table_of_claims() -> None:
    made = placed(*GOOD)
    made.assert_no_crashes()
    ((metric, found),) = made.judged
    assert (metric, found.verdict, found.claim) == (CRASHED, "supported", at_most(0.0))
    assert (found.interval.mean, found.interval.n) == (0.0, len(GOOD))


def test_what_a_test_claims_of_crashes_itself_counts_but_none_must_finish_one() -> None:
    made = placed(*GOOD, also=1)
    made.assert_crashed_at_most(0.5)
    made.check_crashes(0.0)
    undecided = placed(*GOOD, also=1)
    undecided.strict = True
    with pytest.raises(AssertionError, match="inconclusive whether at most 5 %.*--sim-strict"):
        undecided.check_crashes(0.05)
    nothing = placed(also=5)
    nothing.assert_crashed_at_most(1.0)
    with pytest.raises(AssertionError, match="No repetition finished"):
        nothing.check_crashes(0.0)


def test_a_metric_that_is_not_available_is_left_out() -> None:
    made = [record(0, metrics={"placed": None}), record(1, metrics={"placed": 0.5}), record(2)]
    assert ResultSet(made, METRICS).values("placed") == [0.5]


@pytest.mark.parametrize(("relation", "value"), [("at_least", 0), ("at_most", 1.0)])
def test_a_claim_that_cannot_fail_is_refused(relation: str, value: float) -> None:
    with pytest.raises(LimitError, match=r"placed is always at .* %: this claim can never fail"):
        getattr(placed(*GOOD), f"assert_{relation}")("placed", value)


@pytest.mark.parametrize(("better", "claim"), [("higher", at_most(0.5)), ("lower", at_least(0.5))])
def test_no_crash_speaks_for_a_claim(better: Better, claim: Bound) -> None:
    """Of 10 repetitions 9 crashed, which counts as the worst; the other one is against it."""
    metric = Metric("x", "x", better=better, kind="yes_no")
    ended = record(0, metrics={"x": float(better == "higher")})
    made = ResultSet([ended, *(failed(k) for k in range(1, 10))], (metric,))
    assert made.judge("x", claim).verdict is Verdict.NOT_JUDGED


PERFECT = [1.0] * 20
HALF = [1.0, 0.5, 1.0, 1.0, 1.0]


@pytest.mark.parametrize(
    ("values", "crashed", "check", "given"),
    [
        (GOOD, 0, "at_least", ("placed", 0.8)),
        (GOOD, 0, "between", ("placed", 0.8, 1.0)),
        (HALF, 0, "at_least", ("rtf", 10)),
        (HALF, 0, "at_least", ("rtf", 17.5)),  # the same in all repetitions
        (GOOD, 0, "crashed_at_most", (0.15,)),
        (GOOD, 1, "crashed_at_most", (0.3,)),
        (GOOD, 0, "crashed_at_most", (1.0,)),
        (GOOD, 0, "no_crashes", ()),
    ],
)
def test_what_is_supported_passes_without_a_word(
    values: list[float], crashed: int, check: str, given: tuple[Any, ...]
) -> None:
    made = placed(*values, also=crashed)
    made.records += (record(30, status="interrupted"),)  # it counts as neither
    assert len(made.interrupted) == 1
    assert made.interval(CRASHED).n == len(values) + crashed
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        getattr(made, f"assert_{check}")(*given)


@pytest.mark.parametrize(
    ("values", "crashed", "check", "given", "said"),
    [
        (MIXED, 1, "at_least", ("placed", 0.97),
         r"^stacking on engine headless \(tuned\): placed is 85\.71 % on average \(95 % bounds "
         r"62\.9 % and .*, 21 repetitions, 1 crashed and counted as 0 %\), which is below 97 %$"),
        (HALF, 0, "at_most", ("ram_peak", 100), r"ram_peak is 161 MB on average .* above 100 MB"),
        (MIXED, 0, "at_most", ("placed", 0.7), "which is above 70 %"),
        (MIXED, 0, "between", ("placed", 0.97, 1.0), "which is below 97 %"),
        (MIXED, 0, "between", ("placed", 0.1, 0.7), "which is above 70 %"),
        (GOOD, 0, "between", ("placed", 0.0, 0.0), "above 0 %"),
        (HALF, 0, "at_least", ("rtf", 17.6), r"17\.5 on average \(the same in all repetitions, 5"),
        ([1.0], 0, "at_least", ("landing_x", 1.0),
         "landing_x is not available in any of the 1 repetitions that finished"),
        (GOOD[:13], 7, "crashed_at_most", (0.15,), r"95 % bounds 17\.73 % and .*above 15 %"),
        (GOOD, 20, "crashed_at_most", (0.1,), "which is above 10 %"),
        (GOOD, 1, "no_crashes", (), "1 of 21 repetitions crashed: 1 x WorkerHung in settle"),
    ],
)  # fmt: skip
def test_what_is_refuted_fails_with_what_was_measured(
    values: list[float], crashed: int, check: str, given: tuple[Any, ...], said: str
) -> None:
    with pytest.raises(AssertionError, match=said):
        getattr(placed(*values, also=crashed), f"assert_{check}")(*given)


@pytest.mark.parametrize(
    ("values", "crashed", "check", "given", "said"),
    [
        (PERFECT, 0, "at_least", ("placed", 0.9), "83.1 % and 100 %, 20 repetitions): inconclusive "
         "whether at least 90 %, about 14 more repetitions needed"),
        ([1.0], 0, "at_least", ("rtf", 10),
         "is 17.5 on average (no 95 % bounds yet, 1 repetition)"),
        (GOOD, 0, "crashed_at_most", (0.0,), "inconclusive whether at most 0 %"),
        (GOOD, 0, "crashed_at_most", (0.1,), "0 of 20 repetitions crashed (95 % bounds 0 % and"),
        (GOOD, 1, "crashed_at_most", (0.1,), "inconclusive whether at most 10 %"),
    ],
)  # fmt: skip
def test_what_is_not_decided_warns_with_what_was_measured(
    values: list[float], crashed: int, check: str, given: tuple[Any, ...], said: str
) -> None:
    with pytest.warns(InconclusiveWarning, match=re.escape(said)):
        getattr(placed(*values, also=crashed), f"assert_{check}")(*given)


@pytest.mark.parametrize(
    ("check", "given", "said"),
    [
        ("between", ("placed", 0.9, 0.8), "low is above high"),
        ("crashed_at_most", (5,), "between 0 and 1, not at 5; did you mean 0.05?"),
        ("crashed_at_most", (1.5,), "not at 1.5"),
    ],
)
def test_what_is_no_claim_is_refused(check: str, given: tuple[Any, ...], said: str) -> None:
    with pytest.raises(ValueError, match=re.escape(said)):
        getattr(placed(*GOOD), f"assert_{check}")(*given)


def test_an_unknown_metric_lists_the_valid_ones_and_where_it_is_missing() -> None:
    said = r"no metric is named 'place' in stacking on engine headless.*valid names: .*placed"
    with pytest.raises(UnknownMetric, match=said):
        placed(1.0).assert_at_least("place", 0.5)
    with pytest.raises(UnknownMetric, match="'place'; did you mean"):
        ResultSet([], METRICS).metric("place")


@pytest.mark.parametrize("name", ["placed", "hit", "landing_error"])
def test_the_one_value_that_all_repetitions_would_have_is_judged_as_it_is(name: str) -> None:
    """A share and a yes or no were not judged, and no number of repetitions could change it."""
    result = ResultSet([record(1, metrics={name: 1.0}).noting(sole=True)], METRICS)
    result.strict = True
    result.assert_at_least(name, 0.9)
    result.assert_crashed_at_most(0.1)
    with pytest.raises(AssertionError, match="the same in all repetitions, 1 repetition"):
        result.assert_at_most(name, 0.9)
    with pytest.raises(AssertionError, match="not judged whether at most 0.*, it is asked once"):
        result.assert_at_most("ram_peak", 0.0)


def test_strict_fails_what_is_not_decided() -> None:
    for made, reason in ((placed(*[1.0] * 20), "inconclusive"), (placed(1.0), "not judged")):
        made.strict = True
        with pytest.raises(AssertionError, match=rf"{reason} whether at least 90 %.*--sim-strict"):
            made.assert_at_least("placed", 0.9)
        with pytest.raises(AssertionError, match=rf"{reason} whether at most 10 %.*--sim-strict"):
            made.assert_crashed_at_most(0.1)
    decided = placed(*GOOD)
    decided.strict = True
    decided.assert_at_least("placed", 0.7)
    decided.assert_crashed_at_most(0.15)


def test_a_warning_points_at_the_line_of_the_test() -> None:
    for check in (
        lambda: placed(1.0).assert_at_least("placed", 0.9),
        lambda: placed(1.0).assert_crashed_at_most(0.1),
        lambda: placed(1.0).assert_between("placed", 0.1, 0.2),
    ):
        with pytest.warns(InconclusiveWarning) as caught:
            check()
        assert caught[0].filename == __file__


def test_without_a_good_repetition_a_metric_fails_with_the_causes() -> None:
    made = [failed(0), failed(1), failed(2, "WorkerDied", "step")]
    with pytest.raises(AssertionError) as caught:
        ResultSet(made, METRICS).assert_at_least("placed", 0.5)
    assert str(caught.value) == (
        "placed cannot be judged: stacking on engine headless (tuned): 3 of 3 repetitions crashed: "
        "2 x WorkerHung in settle (repetition 0, seed 1000: no answer for 30 s); "
        "1 x WorkerDied in step (repetition 2, seed 1002: no answer for 30 s)"
    )


def test_without_any_repetition_everything_fails() -> None:
    for made in ([], [record(0, status="interrupted")]):
        result = ResultSet(made, METRICS)
        for check in (
            lambda r=result: r.assert_at_least("placed", 0.5),
            result.assert_no_crashes,
            lambda r=result: r.assert_crashed_at_most(0.5),
        ):
            with pytest.raises(AssertionError, match="no repetition has ended"):
                check()


def test_the_summary_is_readable() -> None:
    assert repr(placed(1.0, also=2)) == (
        "<ResultSet stacking on engine headless (tuned): 1 ok, 2 crashed>"
    )


def test_an_interval_has_the_confidence_asked_for() -> None:
    result = placed(*GOOD, also=5)
    for level in (0.8, 0.95, 0.99):
        assert result.interval("placed", level) == interval([*GOOD, *[0.0] * 5], METRICS[0], level)
        assert result.interval(CRASHED, level) == proportion(5, 25, level)
    assert result.interval("placed") == result.interval("placed", 0.95)


def test_a_claim_is_judged_with_the_error_of_the_set() -> None:
    result = placed(*GOOD)
    result.error = 0.2
    assert result.judge("placed", at_least(0.9)).interval.confidence == pytest.approx(0.6)
    with pytest.raises(AssertionError, match="80 % bounds 86.86 % and 98.36 %"):
        result.assert_at_least("placed", 0.999)


def test_a_failure_without_a_cause_is_counted_and_told() -> None:
    result = ResultSet([*records("placed", GOOD), record(20, status="failed")], METRICS)
    assert list(result.causes()) == ["unknown cause"]
    with pytest.raises(AssertionError) as caught:
        result.assert_no_crashes()
    assert str(caught.value).endswith("crashed: 1 x unknown cause (repetition 20, seed 1020)")


def test_a_claim_of_no_crashes_is_told_whether_it_held_or_not() -> None:
    crashed, fine = placed(1.0, also=1), placed(1.0, 1.0)
    with pytest.raises(AssertionError, match="1 of 2 repetitions crashed"):
        crashed.assert_no_crashes()
    fine.assert_no_crashes()
    verdicts = [judged.verdict for of in (crashed, fine) for _, judged in of.judged]
    assert verdicts == ["refuted", "supported"]  # that it held was not told


def test_what_an_engine_says_in_two_lines_is_told_in_one() -> None:
    died = replace(failed(1), error=Failure("EngineFailed", "no world\nof two lines", "load"))
    with pytest.raises(AssertionError, match="no world of two lines"):
        ResultSet([died], METRICS).check_crashes(0.0)
