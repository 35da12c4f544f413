"""The comparison with a baseline: order, verdicts, and no more than the data allow."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pytest_simbench.measure.gate import GateReport, run_gate
from pytest_simbench.measure.limits import parse_limits
from pytest_simbench.records.metrics import Better, Kind, Metric
from pytest_simbench.records.record import Record
from pytest_simbench.report.markdown.run import render_section as markdown
from pytest_simbench.report.model.changes import columns, section
from pytest_simbench.report.terminal.parts import render_changes
from tests.approval import assert_approved
from tests.report.samples import METRICS, STACKING, THROWING, failed, record, stacking_run


def made(placed: float, errors: float, **changes: object) -> list[Record]:
    values = {"placed": placed, "untouched_moved": errors}
    return [record(repetition=k, metrics=values, **changes) for k in range(1, 21)]


def line(text: str, metric: str) -> str:
    """The table's line of a metric."""
    return next(x for x in text.splitlines() if f" {metric} " in x)


def compared(now: list[Record], limits: str = "") -> GateReport:
    known = parse_limits(limits, (*STACKING, *THROWING)) if limits else ()
    return run_gate(made(1.0, 0.0), now, known, METRICS)


def test_terminal_names_differences_first_and_failures_last() -> None:
    report = compared(made(0.8, 0.0, settings={"timestep": 0.004}), "placed:5%,ram:10%")
    text = render_changes(report, 120, True)
    assert text.index("settings.timestep was absent, is 0.004") < text.index("placed  ")
    assert "\n\nFAILED test_stacking[mujoco-headless]: placed fell" in text[-200:]
    assert all(len(line) <= 120 for line in text.splitlines())
    words = line(text, "placed").split()
    assert words[1:8] == ["placed", "100", "%", "80", "%", "-20", "points"]
    assert line(text, "placed").endswith("FAILED, limit 5 points")
    assert line(text, "ram").endswith("passed, limit 10 %")


def test_at_80_columns_it_is_one_table_in_which_tests_stand_above_their_metrics() -> None:
    now = [replace(r, metrics={"placed": (r.metrics["placed"] or 0.0) - 0.3} if r.ok else {})
           for r in stacking_run()]  # fmt: skip
    report = run_gate(stacking_run(), now, parse_limits("placed:5%,ram:10%", STACKING), METRICS)
    told = render_changes(replace(report, others=(), broken=(), notes=()), 80, False)
    assert_approved("terminal-changes", told.partition("\n\nFAILED")[0])


def test_two_tests_of_one_name_are_told_apart() -> None:
    def told(*files: str) -> set[str]:
        side = [
            record(repetition=k, test=f"{file}::test_f[a::b]", metrics={"placed": 1.0})
            for file in files for k in range(20)
        ]  # fmt: skip
        limits = parse_limits("placed:5%", STACKING)
        return {cell.text for cell in columns(run_gate(side, side, limits, METRICS))[0].cells}

    assert told("a.py", "b.py") == {"a.py::test_f[a::b]", "b.py::test_f[a::b]"}
    assert told("a.py") == {"test_f[a::b]"}


def test_a_change_without_a_limit_is_called_worse_or_better_only_when_it_is_sure() -> None:
    worse = render_changes(compared(made(1.0, 3.0)), 120, False)
    assert line(worse, "untouched_moved").endswith("worse")
    few = replace(made(1.0, 0.0)[0], metrics={"placed": 1.0, "untouched_moved": 1.0})
    chance = render_changes(compared([few, *made(1.0, 0.0)[1:]]), 120, False)
    assert line(chance, "untouched_moved").endswith("no clear change")  # a reader sees it change
    assert "too few" not in chance
    assert "untouched_moved" not in render_changes(compared(made(1.0, 0.0)), 120, False)
    assert "passed" not in worse + chance
    error = Metric("error", "error", "m", "lower", study=True)  # and never for rounding
    sides = [
        [record(repetition=k, metrics={"error": v}) for k in range(20)] for v in (0.1, 0.1 + 1e-9)
    ]
    tiny = render_changes(run_gate(*sides, (), {"stacking": (error,)}), 120, False)
    assert line(tiny, "error").endswith("no clear change")


@pytest.mark.parametrize(
    ("number", "told"), [(1, "1 and 1 repetitions are"), (6, "6 pairs are"), (12, "")]
)
def test_too_few_repetitions_hide_no_change_and_are_told_once(number: int, told: str) -> None:
    report = run_gate(made(1.0, 0.0)[:number], made(0.5, 3.0)[:number], (), METRICS)
    text = render_changes(report, 120, False)
    for metric in ("placed", "untouched_moved"):
        assert line(text, metric).endswith("no clear change" if told else "worse")
    sentence = f"metrics without a limit: {told} too few for a change to be significant among"
    assert [note.startswith(sentence) for note in report.notes] == [True] * bool(told)


def test_a_large_change_that_may_be_chance_is_said_to_be_one() -> None:
    now = [*made(1.0, 0.0)[1:], record(repetition=1, metrics={"placed": 0.0})]
    text = render_changes(compared(now, "placed:2%"), 120, True)
    assert line(text, "placed").endswith("may be chance, limit 2 points")
    told = "no metric got worse beyond its limit for sure; 1 did, perhaps by chance"
    assert text.endswith(told)


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
    found = [column.cells[0].text for column in (first, now, change)]
    assert found == [metric.format(before), metric.format(after), shown]


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
    text = render_changes(compared([*now, *made(1.0, 0.0)[crashed:]], limits), 160, True)
    if verdict is None:
        assert "crashed" not in text
    else:
        assert line(text, "crashed").endswith(verdict)


def test_passing_says_that_no_limit_was_tested() -> None:
    same = made(1.0, 0.0)
    report = run_gate(same, same, parse_limits("landing_error:1", THROWING), METRICS, typed=False)
    told = "not significantly more repetitions crashed; no other limit was tested"
    assert render_changes(report, 120, True).endswith(told)
    assert f"- {told}" in markdown(section("x", report))


def test_markdown_escapes_and_lists_failures_before_the_table() -> None:
    text = markdown(section("a_b", compared(made(0.5, 0.0), "placed:5%,landing_error:1")))
    assert text.startswith("## Compared with a\\_b\n")
    first = text.index("- FAILED test\\_stacking\\[mujoco-headless\\]: placed fell")
    assert first < text.index("| :--")
    assert "- FAILED landing\\_error:1 compared nothing: it is not measured there" in text
    assert "got worse" not in text
