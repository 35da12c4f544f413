"""The result in the terminal: the answer first, no line too wide, without -v a screen at most."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.measure.gate import run_gate
from pytest_simbench.records.notes import Notes
from pytest_simbench.records.record import Record
from pytest_simbench.report.model import tables
from pytest_simbench.report.model.document import Column, Table
from pytest_simbench.report.model.summary import TaskSummary, summarise
from pytest_simbench.report.terminal.grid import render
from pytest_simbench.report.terminal.parts import render_changes, render_tables
from pytest_simbench.report.terminal.run import MOST_LINES, render_brief, render_run, render_task
from pytest_simbench.scene.pair_friction import OF_PAIRS
from tests.approval import assert_approved

from .samples import METRICS, REFERENCES, failed, record, stacking_run, throwing_run

EIGHT = ("mujoco", "pybullet", "drake", "dart", "sapien", "ovphysx", "newton", "genesis")


def run_of_eight(**changes: object) -> list[Record]:
    """20 repetitions of two tasks on eight simulators."""
    return [
        record(
            name, k, task, metrics={"placed": 1 - n / 30, "at_end": 0.9, "moved": (n + k % 3) / 12},
            **changes,
        )
        for task in ("stacking", "throwing")
        for n, name in enumerate(EIGHT)
        for k in range(1, 21)
    ]  # fmt: skip


@pytest.fixture(scope="module")
def eight() -> list[TaskSummary]:
    return summarise(run_of_eight(), METRICS)


def test_the_whole_result_of_a_task_at_100_columns() -> None:
    (stacking,) = summarise(stacking_run(), METRICS)
    assert_approved("terminal-whole", render_task(stacking, 100))


def test_the_short_result() -> None:
    assert_approved(
        "terminal-short", render_brief(summarise([*stacking_run(), *throwing_run()], METRICS), 80)
    )


def test_names_that_leave_no_room_stand_above_their_numbers() -> None:
    records = [
        record("mujoco", k, "stacking", test=f"{name}[mujoco]", function=name,
               metrics={"placed": 1.0, "at_end": 0.9})
        for name in ("laboratory/bench/test_towers.py::test_tall", "test_towers.py::test_low")
        for k in range(1, 21)
    ]  # fmt: skip
    assert_approved(
        "terminal-long-names", render_brief(summarise(records, METRICS), 80).partition("\n\n")[2]
    )


@pytest.mark.parametrize("width", [80, 100, 140, 200])
def test_every_line_fits_and_is_plain(eight: list[TaskSummary], width: int) -> None:
    """And of eight simulators at two tasks the short result is a screen."""
    both = summarise(stacking_run() + stacking_run("gui") + throwing_run(), METRICS, REFERENCES)
    whole, brief = render_run(both, width).splitlines(), render_brief(eight, width).splitlines()
    for lines in (whole, brief):
        assert max(map(len, lines)) <= width
        assert all(
            line.isascii() and line.isprintable() and line == line.rstrip() for line in lines
        )
    assert whole[0].startswith("2 simulators did stacking and throwing: 120 repetitions,")
    assert any("pybullet: rolling friction is not modelled" in line for line in whole)
    assert len(brief) <= MOST_LINES
    for name in EIGHT:
        assert sum(line.startswith(f"{name} ") for line in brief) == 2


@pytest.mark.parametrize("width", [80, 140])
def test_warnings_take_what_is_left_and_say_how_many_more(width: int) -> None:
    records = run_of_eight(contended=True, reused_worker=True, notes=Notes(untested="an old one"))
    for n, name in enumerate(EIGHT):
        records += [
            failed(kind, "load", "gone " * 50, simulator=name, repetition=30 + 10 * n + k)
            for k, kind in enumerate(("WorkerDied", "WorkerHung"))
        ]
    report = render_brief(summarise(records, METRICS), width)
    lines = report.splitlines()
    assert len(lines) <= MOST_LINES
    assert max(map(len, lines)) <= width
    assert "CRASHED stacking, dart headless tuned: 1 x WorkerDied in" in report
    assert re.fullmatch(r"\d+ more warnings with -v and in the report", lines[-1])


def test_a_loop_that_stood_open_is_told() -> None:
    report = render_brief(summarise(run_of_eight(notes=Notes(opened=0.0123)), METRICS), 100)
    assert "note: all: loops of links stood open at the end, by up to 12 mm" in report


def test_notes_of_one_text_stand_together_and_say_what_is_not_described() -> None:
    report = render_brief(summarise(run_of_eight(contended=True), METRICS), 100)
    assert report.count("note:") == 1
    assert "note: all: repetitions ran in parallel: its times and CPU are contended" in report
    wrong = f"{OF_PAIRS}not the scene's: of a and b it is 0.6, not 1"
    both = [record(simulator=name, deviations=("soft", wrong)) for name in ("drake", "dart")]
    twice = [*both, *(replace(one, task="throwing") for one in both), record()]
    report = render_brief(summarise(twice, METRICS), 100)
    assert report.count("note:") == 1
    assert f"note: dart, drake: {wrong}" in report
    undescribed = render_brief(summarise([record(metrics={"placed": 1.0})], {}), 100)
    assert "note: stacking: the run does not say what its metrics mean" in undescribed


def test_colour_wishes_of_the_environment_are_ignored(monkeypatch: pytest.MonkeyPatch) -> None:
    summaries = summarise(stacking_run(), METRICS)
    plain = render_run(summaries, 80)
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "200")
    assert render_run(summaries, 80) == plain


def test_long_messages_are_wrapped_and_kept_whole() -> None:
    words = [f"word{number}" for number in range(40)]
    (summary,) = summarise([failed("WorkerHung", "settle", " ".join(words))], METRICS)
    report = render(tables.failures(summary), 80)
    assert max(map(len, report.splitlines())) <= 80
    assert set(words) <= {word.rstrip(";") for word in report.split()}


def test_a_simulator_that_only_failed_still_has_its_row() -> None:
    gone = failed("WorkerDied", "load", "gone", repetition=1)
    (summary,) = summarise([gone], METRICS)
    assert "0 / 0 / 0" in render(tables.study(summary), 140)  # it counts, but not for the study
    (summary,) = summarise([failed("WorkerDied", "load", "gone", protocol="paper")], METRICS)
    assert render(tables.study(summary), 140).splitlines()[-1].split() == [
        *["mujoco", "headless", "tuned", "1", "of", "1", "[3,", "100]", "%"],
        *["-"] * 8,
    ]
    assert tables.time_spent(summary) == tables.stricter(summary) == []


def test_few_repetitions_give_no_false_confidence_and_interrupted_ones_are_named() -> None:
    cut = record(repetition=2, status="interrupted")
    (summary,) = summarise([record(metrics={"placed": 14 / 15, "at_end": 1.0}), cut], METRICS)
    report = render_task(summary, 100)
    assert "placed: mujoco 93 % [2, 100]." in report
    assert "at the end: mujoco 100 % [2, 100]." in report
    assert "Lengths, times and costs have no interval for fewer than 5 values" in tables.LEGEND
    assert "0 of 1" in report
    assert "1 cut" in report


def test_an_empty_run_prints_nothing() -> None:
    assert render_run([], 80) == render_brief([], 80) == ""


def test_what_there_is_not_leaves_no_empty_lines() -> None:
    table = Table("seeds", [Column("a", ["1", "2"])])
    assert render_tables([table] * 2, 80).split("\n") == [
        "seeds",
        "-----",
        "",
        "a",
        "-",
        "1",
        "2",
        "",
        "seeds",
        "-----",
        "",
        "a",
        "-",
        "1",
        "2",
    ]
    same = run_gate(stacking_run(), stacking_run(), (), METRICS)
    shown = render_changes(same, 80, limited=False)
    passed = "not significantly more repetitions crashed; no other limit was tested"
    assert render_changes(same, 80, limited=True) == f"{shown}\n\n{passed}"


def test_a_table_too_wide_is_cut_by_group_and_its_rows_named_again() -> None:
    columns = [
        Column("name", ["a", "b"], left=True),
        Column("first one", ["1", "2"], "x"),
        Column("second", ["3", "4"], "y"),
    ]
    assert_approved("terminal-cut", render(columns, 14))


def test_a_table_too_wide_below_its_names_is_told_apart_and_nothing_is_cut() -> None:
    columns = [
        Column("test", ["a", "a", "b"], left=True, above=True),
        Column("metric", ["placed", "hit", "hit"], left=True),
        Column("value", ["0.12 [0.1, 0.2]"] * 3),
        Column("verdict", ["worse by far"] * 3, left=True, wrap=True),
    ]
    lines = [line.split() for line in render(columns, 24).splitlines() if line]
    value, verdict = ["0.12", "[0.1,", "0.2]"], ["worse", "by", "far"]
    assert [line for line in lines if line[0][0] != "-"] == [
        ["a"], ["metric", "value"], ["placed", *value], ["hit", *value],
        ["metric", "verdict"], ["placed", *verdict], ["hit", *verdict],
        ["b"], ["metric", "value"], ["hit", *value], ["metric", "verdict"], ["hit", *verdict],
    ]  # fmt: skip


@given(
    st.lists(st.lists(st.integers(1, 9), min_size=1, max_size=2), min_size=3, max_size=9),
    st.integers(0, 30),
)
def test_numbers_are_whole_wherever_there_is_room_for_a_column(
    found: list[list[int]], room: int
) -> None:
    """Cells of one or two lines, each line of a letter of its own."""
    letters = iter("abcdefghijklmnopqrst")
    cells = [[next(letters) * n for n in cell] for cell in found]
    columns = [Column("long word", cells[k::3][: len(cells) // 3]) for k in range(3)]
    lines = [[line for cell in column.cells for line in cell.lines] for column in columns]
    label, *others = (max(4, *map(len, of)) for of in lines)
    shown = render(columns, label + 2 + max(others) + room).splitlines()
    assert max(map(len, shown)) <= label + 2 + max(others) + room
    assert {line for of in lines for line in of} <= {*" ".join(shown).split()}
