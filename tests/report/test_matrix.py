"""The matrix of who beats whom."""

from __future__ import annotations

from pytest_simbench.report.markdown import run as markdown
from pytest_simbench.report.model import tables as columns
from pytest_simbench.report.model.matrix import with_differences
from pytest_simbench.report.model.summary import TaskSummary, summarise
from pytest_simbench.report.terminal.run import render_run

from .samples import METRICS, record, stacking_run


def summary(records: list) -> TaskSummary:  # type: ignore[type-arg]
    (found,) = with_differences(summarise(records, METRICS), records)
    return found


def test_the_better_simulator_beats_the_other_and_not_itself() -> None:
    found = summary(stacking_run())
    table = {c.heading: [" ".join(cell) for cell in c.cells] for c in columns.matrix(found)}
    assert table["simulator"] == ["mujoco", "pybullet"]
    assert table["pybullet"] == ["placed, at_end, untouched_moved", ""]
    assert table["mujoco"] == ["", "-"]


def test_it_is_in_the_terminal_and_in_the_report() -> None:
    records = stacking_run()
    found = with_differences(summarise(records, METRICS), records)
    assert columns.MATRIX in " ".join(render_run(found, 100).split())
    assert columns.MATRIX[1:] in markdown.render_run(found)
    assert max(map(len, render_run(found, 80).splitlines())) <= 80


def test_modes_are_not_set_against_each_other() -> None:
    good = [record("mujoco", k, metrics={"placed": 1.0}) for k in range(20)]
    poor = [record("mujoco", k, mode="gui", metrics={"placed": 0.2}) for k in range(20)]
    assert summary([*good, *poor]).differences == ()


def test_without_a_winner_there_is_no_matrix() -> None:
    same = [record(name, k, metrics={"placed": 1.0}) for name in ("a", "b") for k in range(20)]
    assert columns.matrix(summary(same)) == []
