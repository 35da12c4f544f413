"""The short result in the terminal: the answer first, and never longer than a screen."""

from __future__ import annotations

import re

import pytest

from pytest_simbench.records.notes import Notes
from pytest_simbench.records.record import Record
from pytest_simbench.report.model.matrix import with_differences
from pytest_simbench.report.model.summary import TaskSummary, summarise
from pytest_simbench.report.terminal.brief import MOST_LINES, render_brief

from .samples import METRICS, failed, record, stacking_run, throwing_run
from .test_tables import text

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


def summaries(records: list[Record]) -> list[TaskSummary]:
    return summarise(records, METRICS)


@pytest.fixture(scope="module")
def eight() -> list[TaskSummary]:
    return with_differences(summaries(run_of_eight()), run_of_eight())


def test_the_answer_comes_first_then_a_line_for_each_row() -> None:
    records = [*stacking_run(), *throwing_run()]
    assert render_brief(with_differences(summaries(records), records), 80) == text(
        """
        2 simulators did stacking and throwing: 80 repetitions, 3 crashed (pybullet
          3).
        Outcome: stacking, placed and at the end: mujoco ahead (behind: pybullet);
          throwing, moved: a difference needs at least 6 pairs that differ; so far 1.
        Cost: CPU s per simulated s, stacking and throwing: not compared; RAM,
          stacking and throwing: a difference needs at least 6 pairs that differ; so far
          none.

        stacking: 20 repetitions each, protocol fast
                                           at the end      CPU  RAM  x real
        simulator  crashed      placed %            %  s/sim s   MB    time
        -------------------------------------------------------------------
        mujoco     0 of 20  99 [79, 100]  97 [77, 99]    0.048  150      20
        pybullet   3 of 20   65 [40, 78]  77 [46, 91]    0.048  150      20

        throwing: 20 repetitions each, protocol fast
                                             CPU  RAM  x real
        simulator  crashed      moved %  s/sim s   MB    time
        -----------------------------------------------------
        mujoco     0 of 20  42 [33, 54]    0.048  150      20
        pybullet   0 of 20  39 [27, 52]    0.048  150      20

        CRASHED stacking, pybullet headless tuned: 2 x WorkerHung in settle: no answer
          within 60 s
        CRASHED stacking, pybullet headless tuned: 1 x WorkerDied in pick: the worker
          was killed by SIGSEGV
        """
    )


@pytest.mark.parametrize("width", [60, 80, 100, 140, 200])
def test_a_run_of_eight_is_a_screen(eight: list[TaskSummary], width: int) -> None:
    report = render_brief(eight, width)
    lines = report.splitlines()
    assert len(lines) <= MOST_LINES
    assert max(map(len, lines)) <= width
    assert report.isascii()
    assert all(line == line.rstrip() for line in lines)
    for name in EIGHT:
        assert sum(line.startswith(f"{name} ") for line in lines) == 2
    assert "crashed" in report
    assert "placed %" in report


@pytest.mark.parametrize("width", [60, 80, 140])
def test_warnings_take_what_is_left_and_say_how_many_more(width: int) -> None:
    records = run_of_eight(contended=True, reused_worker=True, notes=Notes(untested="an old one"))
    for n, name in enumerate(EIGHT):
        records += [
            failed(kind, "load", "gone " * 50, simulator=name, repetition=30 + 10 * n + k)
            for k, kind in enumerate(("WorkerDied", "WorkerHung"))
        ]
    report = render_brief(summaries(records), width)
    lines = report.splitlines()
    assert len(lines) <= MOST_LINES
    assert max(map(len, lines)) <= width
    assert "CRASHED stacking, dart headless tuned: 1 x WorkerDied in" in report
    assert re.fullmatch(r"\d+ more warnings with -v and in the report", lines[-1])


def test_notes_of_one_text_stand_together() -> None:
    report = render_brief(summaries(run_of_eight(contended=True)), 100)
    assert report.count("note:") == 1
    assert "note: all: repetitions ran in parallel: its times and CPU are contended" in report


def test_a_failure_names_its_cause() -> None:
    report = render_brief(summaries([failed("WorkerDied", "load", "gone")]), 100)
    assert "CRASHED stacking, mujoco headless tuned: 1 x WorkerDied in load: gone" in report
    assert "1 of 1" in report


def test_a_run_that_does_not_say_what_its_metrics_mean_is_told_of() -> None:
    report = render_brief(summarise([record(metrics={"placed": 1.0})], {}), 100)
    assert "note: stacking: the run does not say what its metrics mean" in report


def test_of_nothing_nothing_is_printed() -> None:
    assert render_brief([], 80) == ""
