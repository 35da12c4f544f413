"""The report is a function of the run folder, whoever wrote that and whatever they say in it."""

from __future__ import annotations

import json
import subprocess
import sys
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.measure.gate import run_gate
from pytest_simbench.measure.limits import Limit
from pytest_simbench.records.description import TaskDescription
from pytest_simbench.records.folder import Reading, RunFolder
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.repeatability import Line, append
from pytest_simbench.report.files import summaries_of, write_report
from pytest_simbench.report.markdown import run as markdown
from pytest_simbench.report.model import changes
from pytest_simbench.report.model.repeatability import write_tables
from pytest_simbench.report.terminal import run as tables
from tests.hostile import assert_harmless_markdown, assert_harmless_terminal

from .samples import METRICS, REFERENCES, record, stacking_run, throwing_run


def test_a_folder_is_all_that_it_takes(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path)
    for item in stacking_run() + throwing_run():
        folder.append(item)
    for task, metrics in METRICS.items():
        folder.describe(TaskDescription(task, metrics, REFERENCES.get(task, {})))
    written = write_report(RunFolder(tmp_path))
    assert written.complete
    report = (tmp_path / "report.md").read_text()
    assert "| release speed m/s |" in report
    assert "| reference |" in report
    assert "does not say" not in report
    assert [summary.task for summary in written.summaries] == ["stacking", "throwing"]
    before = {path: path.read_bytes() for path in tmp_path.glob("report.*")}
    assert len(before) == 3
    write_report(RunFolder(tmp_path))
    assert {path: path.read_bytes() for path in before} == before


def test_reading_loads_no_planner(tmp_path: Path) -> None:
    """One of them prints what it has leaked when a process ends."""
    for item in stacking_run():
        RunFolder(tmp_path).append(item)
    command = [sys.executable, "-X", "importtime", "-m", "pytest", "--sim-report", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=True)
    imported = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    assert "pytest_simbench.tasks.base" in imported
    assert not imported & {"ompl", "ruckig", "pytest_simbench.tasks.stacking"}
    assert "leaked" not in done.stderr


def test_without_descriptions_numbers_are_plain_and_a_note_says_why(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path)
    for item in stacking_run():
        folder.append(item)
    (summary,) = write_report(RunFolder(tmp_path)).summaries
    assert {metric.better for metric in summary.metrics} == {None}
    for text in (tables.render_task(summary, 200), (tmp_path / "report.md").read_text()):
        assert "note: stacking: the run does not say what its metrics mean" in text


names = st.sampled_from(["placed", "ram", "failures", "", "\x1b[31m", "a|b\n<b>", "ä" * 40])
metrics = st.lists(
    st.builds(
        Metric,
        name=names.filter(bool),
        title=names.filter(bool),
        unit=names,
        better=st.sampled_from(["higher", "lower", None]),
        kind=st.sampled_from(["share", "yes_no", "value"]),
        of=st.integers(1, 10**300),
        study=st.booleans(),
        doc=names,
        resolution=st.none() | st.floats(0, 1e308),
        least=st.none() | st.integers(-5, 5) | st.floats(-1e308, 1e308),
    ),
    max_size=4,
    unique_by=lambda metric: metric.name,
)
numbers = st.none() | st.integers(-5, 5) | st.floats(allow_nan=False, allow_infinity=False)
descriptions = st.builds(
    TaskDescription,
    st.just("task"),
    metrics.map(tuple),
    st.dictionaries(names, numbers.filter(bool)),
)
values = st.lists(st.dictionaries(names, numbers, max_size=4), min_size=1, max_size=12)


def reading(said: TaskDescription, of: list[dict[str, Any]], **more: Any) -> Reading:
    """A run that says one thing and holds another; both as they come from the disk."""
    said = TaskDescription.from_dict(json.loads(json.dumps(said.to_dict())))
    found = [
        record(("mujoco", "drake")[k % 2], k // 2, "task", metrics=item, seed=k // 2, **more)
        for k, item in enumerate(of)
    ]
    return Reading("run", tuple(found), {"task": said})


@given(descriptions, values)
def test_whatever_is_said_of_whatever_numbers_is_shown(
    said: TaskDescription, of: list[dict[str, Any]]
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        summaries = summaries_of(reading(said, of))
    assert_harmless_terminal(tables.render_run(summaries, 100))
    assert_harmless_markdown(markdown.render_run(summaries))


@given(descriptions, values, values, st.booleans())
def test_whatever_is_said_is_compared_or_left_out(
    said: TaskDescription, of: list[dict[str, Any]], now: list[dict[str, Any]], percent: bool
) -> None:
    limits = [Limit(m.name, 0.05, percent) for m in said.metrics if m.better]
    before, after = reading(said, of), reading(said, now)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        report = run_gate(before.records, after.records, limits, after.metrics)
    assert_harmless_terminal(changes.render_terminal(report, 100, True))


LINE = Line("search", "t::x", "m", "headless", "tuned", "towers", 1, {}, {}, {"sentence": "0.1 mm"})


def test_repeatability_is_told_from_the_folder_too(tmp_path: Path) -> None:
    assert write_tables(tmp_path, tmp_path) == ([], [])
    append(tmp_path, LINE)
    append(tmp_path, replace(LINE, kind="guess"))
    found, problems = write_tables(tmp_path, tmp_path)
    assert [title for title, _, _ in found] == ["Perturbation"]
    assert problems == [f"{tmp_path / 'repeatability.jsonl'}:2: not a result on repeatability"]
    assert "0.1 mm" in (tmp_path / "repeatability.md").read_text()
