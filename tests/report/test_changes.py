"""The comparison with a baseline as text: order, verdicts, and no more than the data allow."""

from __future__ import annotations

from dataclasses import replace

from pytest_simbench.measure.gate import GateReport, run_gate
from pytest_simbench.measure.limits import parse_limits
from pytest_simbench.records.record import Record
from pytest_simbench.report.changes import render_markdown, render_terminal

from .samples import METRICS, STACKING, THROWING, record


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


def test_markdown_escapes_and_lists_failures_before_the_table() -> None:
    report = compared(made(0.5, 0.0), "placed:5%,landing_error:1")
    text = render_markdown(report, "a_b", True)
    assert text.startswith("## Compared with a\\_b\n")
    assert text.index("- FAILED test\\_stacking\\[mujoco-headless\\]: placed fell") < text.index(
        "| :--"
    )
    assert "- not compared: landing\\_error was not measured in both runs" in text
    assert "Passed" not in text
    assert "Passed: no metric got worse" in render_markdown(
        compared(made(1.0, 0.0), "placed:5%"), "x", True
    )
