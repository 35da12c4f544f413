"""The comparison with a baseline as text: order, verdicts, and no more than the data allow."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pytest_simbench.measure.gate import GateReport, run_gate
from pytest_simbench.measure.limits import parse_limits
from pytest_simbench.records.metrics import Better, Kind, Metric
from pytest_simbench.records.record import Record
from pytest_simbench.report.model.changes import columns, render_markdown, render_terminal

from .samples import METRICS, STACKING, THROWING, failed, record


def made(placed: float, errors: float, **changes: object) -> list[Record]:
    values = {"placed": placed, "untouched_moved": errors}
    return [record(repetition=k, metrics=values, **changes) for k in range(1, 21)]


def line(text: str, metric: str) -> str:
    """The table's line of a metric."""
    return next(x for x in text.splitlines() if f" {metric} " in x)


def compared(now: list[Record], limits: str = "") -> GateReport:
    before = made(1.0, 0.0)
    return run_gate(
        before, now, parse_limits(limits, (*STACKING, *THROWING)) if limits else (), METRICS
    )


def test_terminal_names_differences_first_and_failures_last() -> None:
    report = compared(made(0.8, 0.0, settings={"timestep": 0.004}), "placed:5%,ram:10%")
    text = render_terminal(report, 120, True)
    assert text.index("settings.timestep was absent, is 0.004") < text.index("placed  ")
    assert "\n\nFAILED test_stacking[mujoco-headless]: placed fell" in text[-200:]
    assert all(len(line) <= 120 for line in text.splitlines())
    words = line(text, "placed").split()
    assert words[1:8] == ["placed", "100", "%", "80", "%", "-20", "points"]
    assert line(text, "placed").endswith("FAILED, limit 5 points")
    assert line(text, "ram").endswith("passed, limit 10 %")


def test_a_change_without_a_limit_is_called_worse_or_better_only_when_it_is_sure() -> None:
    worse = render_terminal(compared(made(1.0, 3.0)), 120, False)
    assert line(worse, "untouched_moved").endswith("worse")
    few = replace(made(1.0, 0.0)[0], metrics={"placed": 1.0, "untouched_moved": 1.0})
    chance = render_terminal(compared([few, *made(1.0, 0.0)[1:]]), 120, False)
    assert "untouched_moved" not in chance  # neither of the study's metrics nor a clear change
    assert "passed" not in worse + chance


def test_a_large_change_that_may_be_chance_is_said_to_be_one() -> None:
    now = [*made(1.0, 0.0)[1:], record(repetition=1, metrics={"placed": 0.0})]
    text = render_terminal(compared(now, "placed:2%"), 120, True)
    assert line(text, "placed").endswith("may be chance, limit 2 points")
    assert text.endswith("no metric got worse beyond its limit")


@pytest.mark.parametrize(
    ("before", "after", "shown"),
    [
        (1.0, 0.8, "-20 points"),
        (0.8, 1.0, "+20 points"),
        (1.0, 1.0, "0"),
        (2.0, 3.0, "+50 %"),
        (3.0, 2.0, "-33.3 %"),
    ],
)
@pytest.mark.parametrize("better", ["higher", "lower"])
def test_the_sign_is_that_of_the_number_whichever_direction_is_good(
    better: Better, before: float, after: float, shown: str
) -> None:
    kind: Kind = "share" if "points" in shown or before == after else "value"
    metric = Metric("m", "m", better=better, kind=kind, of=15 if kind == "share" else None)
    sides = [[record(repetition=k, metrics={"m": v}) for k in range(20)] for v in (before, after)]
    report = run_gate(*sides, parse_limits("m:1%", [metric]), {"stacking": (metric,)})
    (_, _, first, now, change, _, _) = columns(report)
    found = (first.cells[0], now.cells[0], change.cells[0])
    assert found == ([metric.format(before)], [metric.format(after)], [shown])


@pytest.mark.parametrize(
    ("crashed", "limits", "verdict"),
    [
        (0, "placed:5%", None),
        (4, "placed:5%", "may be chance, limit 0 points"),
        (5, "placed:5%", "FAILED, limit 0 points"),
        (5, "crashed:30%", "passed, limit 30 points"),
    ],
)
def test_crashes_are_shown_where_there_are_any(
    crashed: int, limits: str, verdict: str | None
) -> None:
    now = [failed("WorkerHung", "settle", "", repetition=k) for k in range(1, crashed + 1)]
    report = compared([*now, *made(1.0, 0.0)[crashed:]], limits)
    text = render_terminal(report, 160, True)
    if verdict is None:
        assert "crashed" not in text
    else:
        assert line(text, "crashed").endswith(verdict)


def test_passing_says_that_no_limit_was_tested() -> None:
    same = made(1.0, 0.0)
    limits = parse_limits("landing_error:1", THROWING)
    report = run_gate(same, same, limits, METRICS, typed=False)
    told = "not significantly more repetitions crashed; no other limit was tested"
    assert render_terminal(report, 120, True).endswith(told)
    assert f"Passed: {told}." in render_markdown(report, "x", True)


def test_markdown_escapes_and_lists_failures_before_the_table() -> None:
    report = compared(made(0.5, 0.0), "placed:5%,landing_error:1")
    text = render_markdown(report, "a_b", True)
    assert text.startswith("## Compared with a\\_b\n")
    assert text.index("- FAILED test\\_stacking\\[mujoco-headless\\]: placed fell") < text.index(
        "| :--"
    )
    assert "- FAILED landing\\_error:1 compared nothing: it is not measured there" in text
    assert "Passed" not in text
    assert "Passed: no metric got worse" in render_markdown(
        compared(made(1.0, 0.0), "placed:5%"), "x", True
    )
