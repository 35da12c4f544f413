"""The terminal report, compared as the text a reader sees."""

from __future__ import annotations

import textwrap
from dataclasses import replace

import pytest

from pytest_simbench.report.model import tables as columns
from pytest_simbench.report.model.summary import TaskSummary, summarise
from pytest_simbench.report.terminal.grid import Column, render
from pytest_simbench.report.terminal.run import render_run, render_task

from .samples import METRICS, REFERENCES, failed, record, stacking_run, throwing_run, two_errors


def stacking() -> TaskSummary:
    return summarise(stacking_run(), METRICS, ends=two_errors)[0]


def throwing() -> TaskSummary:
    return summarise(throwing_run(), METRICS, REFERENCES, two_errors)[0]


def text(block: str) -> str:
    return textwrap.dedent(block).strip("\n")


def test_study_table_and_what_explains_it_at_100_columns() -> None:
    assert render_task(stacking(), 100) == text(
        """
        stacking: 20 repetitions each, protocol fast
        ============================================
        placed: mujoco 99 % [97, 100] and pybullet 65 % [52, 78]; not compared.
        at the end: mujoco 97 % [94, 99] and pybullet 77 % [62, 92]; not compared.
        crashes: pybullet 3 of 20.

        simulator                          crashed                 placed %            at the end %
        -------------------------------------------------------------------------------------------
        mujoco headless tuned    0 of 20 [0, 17] %  93 / 99 / 100 [97, 100]  87 / 97 / 100 [94, 99]
        pybullet headless tuned  3 of 20 [3, 38] %     0 / 65 / 87 [52, 78]   0 / 77 / 100 [62, 92]

                                                x real
        simulator          CPU %      RAM MB      time     CPU s/sim s       start s       end s
        ----------------------------------------------------------------------------------------
        mujoco           99 +- 3    150 +- 2        20           0.048          0.80         9.8
        headless tuned  [99, 99]  [150, 150]  [20, 20]  [0.048, 0.048]  [0.80, 0.80]  [9.8, 9.8]
                                  (peak 161)

        pybullet         99 +- 3    150 +- 2        20           0.048          0.80         9.8
        headless tuned  [99, 99]  [150, 150]  [20, 20]  [0.048, 0.048]  [0.80, 0.80]  [9.8, 9.8]
                                  (peak 161)

        stacking, crashes
        simulator                count  failure     phase   repetitions  message
        ----------------------------------------------------------------------------------------------------
        pybullet headless tuned      2  WorkerHung  settle  8, 9         no answer within 60 s; last line of
                                                                         its log: died
        pybullet headless tuned      1  WorkerDied  pick    3            the worker was killed by SIGSEGV;
                                                                         last line of its log: died

        stacking, further metrics: mean [95 % interval]
                           placed  at the end               untouched
        simulator        strict %    strict %  towers %   moved cubes    failed picks
        -----------------------------------------------------------------------------
        mujoco                 98          96        90             0            0.05
        headless tuned   [97, 99]    [93, 99]  [83, 97]        [0, 0]   [-0.05, 0.15]

        pybullet               84          82        78          0.47           0.059
        headless tuned  [67, 100]    [66, 98]  [62, 95]  [0.22, 0.72]  [-0.059, 0.18]

        stacking, where the time went: mean wall seconds and share
                                                                                             total
        simulator                  launch s      load s      plan s      step s     other s      s
        ------------------------------------------------------------------------------------------
        mujoco headless tuned    0.50 (5 %)  0.30 (3 %)  1.0 (10 %)  8.0 (80 %)  0.20 (2 %)   10.0
        pybullet headless tuned  0.50 (5 %)  0.30 (3 %)  1.0 (10 %)  8.0 (80 %)  0.20 (2 %)   10.0
        """  # noqa: E501
    )


def test_study_table_at_140_columns_is_one_table() -> None:
    assert render(columns.study(stacking()), 140) == text(
        """
                                                                                         x real
        simulator         crashed       placed %   at the end %     CPU %      RAM MB      time     CPU s/sim s       start s       end s
        ---------------------------------------------------------------------------------------------------------------------------------
        mujoco            0 of 20  93 / 99 / 100  87 / 97 / 100   99 +- 3    150 +- 2        20           0.048          0.80         9.8
        headless tuned  [0, 17] %      [97, 100]       [94, 99]  [99, 99]  [150, 150]  [20, 20]  [0.048, 0.048]  [0.80, 0.80]  [9.8, 9.8]
                                                                           (peak 161)

        pybullet          3 of 20    0 / 65 / 87   0 / 77 / 100   99 +- 3    150 +- 2        20           0.048          0.80         9.8
        headless tuned  [3, 38] %       [52, 78]       [62, 92]  [99, 99]  [150, 150]  [20, 20]  [0.048, 0.048]  [0.80, 0.80]  [9.8, 9.8]
                                                                           (peak 161)
        """  # noqa: E501
    )


def test_throwing_metrics_stand_below_their_reference_at_80_columns() -> None:
    assert render(columns.stricter(throwing()), 80) == text(
        """
                                      lost in
        simulator            hit %  transit %     landing x m   landing error m
        -----------------------------------------------------------------------
        reference                                       1.352

        mujoco                 100          0           1.358             0.006
        headless tuned  [100, 100]     [0, 0]  [1.357, 1.359]  [0.0054, 0.0066]

        pybullet                95          5           1.324             0.028
        headless tuned   [85, 100]    [0, 15]  [1.323, 1.325]    [0.027, 0.029]

                        release position       release  release velocity    release time
        simulator                error m     speed m/s         error m/s         error s
        --------------------------------------------------------------------------------
        reference                                2.753

        mujoco                    0.0051          2.74              0.02               0
        headless tuned  [0.0048, 0.0053]  [2.74, 2.74]      [0.02, 0.02]          [0, 0]

        pybullet                  0.0051          2.74              0.02           0.002
        headless tuned  [0.0048, 0.0053]  [2.74, 2.74]      [0.02, 0.02]  [0.002, 0.002]
        """
    )


@pytest.mark.parametrize("width", [60, 80, 100, 140, 200])
def test_every_line_fits_and_is_plain(width: int) -> None:
    summaries = summarise(
        stacking_run() + stacking_run("gui") + throwing_run(), METRICS, REFERENCES
    )
    report = render_run(summaries, width)
    lines = report.splitlines()
    assert max(map(len, lines)) <= width
    assert report.isascii()
    assert report.isprintable() or set(report) - {"\n"} == {c for c in report if c.isprintable()}
    assert all(line == line.rstrip() for line in lines)
    assert lines[0].startswith("2 simulators did stacking and throwing: 120 repetitions,")
    assert "pybullet: rolling friction is not modelled" in report


def test_colour_wishes_of_the_environment_are_ignored(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = render_run([stacking()], 80)
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "200")
    assert render_run([stacking()], 80) == plain


def test_long_messages_are_wrapped_and_kept_whole() -> None:
    message = " ".join(f"word{number}" for number in range(40))
    (summary,) = summarise([failed("WorkerHung", "settle", message)], METRICS)
    report = render(columns.failures(summary), 80)
    assert max(map(len, report.splitlines())) <= 80
    words = set(report.split())
    assert {f"word{number}" for number in range(40)} <= {word.rstrip(";") for word in words}


def test_a_simulator_that_only_failed_still_has_its_row() -> None:
    gone = failed("WorkerDied", "load", "gone", repetition=1)
    (summary,) = summarise([gone], METRICS)
    assert "0 / 0 / 0" in render(columns.study(summary), 140)  # it counts, but not for the study
    (summary,) = summarise([replace(gone, protocol="paper")], METRICS)
    table = render(columns.study(summary), 140)
    assert table.splitlines()[-1].split() == [
        *["mujoco", "headless", "tuned", "1", "of", "1", "[3,", "100]", "%"],
        *["-"] * 8,
    ]
    assert columns.time_spent(summary) == []
    assert columns.stricter(summary) == []


def test_interrupted_repetitions_are_named() -> None:
    records = [record(metrics={"placed": 1.0}), record(repetition=2, status="interrupted")]
    report = render_task(summarise(records, METRICS)[0], 80)
    assert "1 cut" in report
    assert "0 of 1" in report


def test_one_repetition_gives_no_false_confidence() -> None:
    (summary,) = summarise([record(metrics={"placed": 14 / 15, "at_end": 1.0})], METRICS)
    report = render_task(summary, 100)
    assert "placed: mujoco 93 % [2, 100]." in report
    assert "at the end: mujoco 100 % [2, 100]." in report


def test_an_empty_run_prints_nothing() -> None:
    assert render_run([], 80) == ""


def test_a_table_too_wide_is_cut_by_group_and_its_rows_named_again() -> None:
    table = render(
        [
            Column("name", [["a"], ["b"]], left=True),
            Column("first one", [["1"], ["2"]], "x"),
            Column("second", [["3"], ["4"]], "y"),
        ],
        14,
    )
    assert table == text(
        """
              first
        name    one
        -----------
        a         1
        b         2

        name  second
        ------------
        a          3
        b          4
        """
    )
