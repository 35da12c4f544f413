"""The files of a run are a function of its folder, whoever wrote that and whatever it says."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.measure.gate import run_gate
from pytest_simbench.measure.limits import Limit
from pytest_simbench.records.description import TaskDescription
from pytest_simbench.records.folder import RunContents, RunFolder
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.record import Record
from pytest_simbench.records.repeatability import Line, append
from pytest_simbench.report.files import (
    Written,
    columns_of,
    where,
    write_badge,
    write_files,
    write_tables,
)
from pytest_simbench.report.markdown.github import LARGEST, VARIABLE, append_summary, badge
from pytest_simbench.report.markdown.run import render_run
from pytest_simbench.report.model.report import Report
from pytest_simbench.report.model.summary import summarise
from pytest_simbench.report.terminal import run as terminal
from pytest_simbench.report.terminal.parts import render_changes
from tests.approval import assert_approved
from tests.hostile import HOSTILE, assert_harmless_markdown, assert_harmless_terminal

from .samples import METRICS, REFERENCES, failed, record, stacking_run, throwing_run


def folder_of(path: Path, *records: Record, described: bool = True) -> RunFolder:
    folder = RunFolder(path)
    for item in records:
        folder.append(item)
    for task, metrics in METRICS.items() if described else ():
        folder.describe(TaskDescription(task, metrics, REFERENCES.get(task, {})))
    return RunFolder(path)


def written_in(folder: RunFolder) -> Written:
    return write_files(folder.path, Report.of(folder.read()))


def test_the_csv_file_tells_tasks_of_one_test_apart() -> None:
    two = [record(settings={"task.towers": k, "timestep": 0.002}) for k in (3, 4)]
    assert columns_of(two)["parameters"] == ['{"task.towers": 3}', '{"task.towers": 4}']


def test_a_folder_is_all_that_it_takes(tmp_path: Path) -> None:
    written = written_in(folder_of(tmp_path, *stacking_run(), *throwing_run()))
    assert written.complete
    report = (tmp_path / "report.md").read_text()
    assert "| release speed m/s |" in report
    assert "| reference |" in report
    assert "does not say" not in report
    assert [summary.task for summary in written.summaries] == ["stacking", "throwing"]
    before = {path: path.read_bytes() for path in tmp_path.glob("report.*")}
    assert len(before) == 3
    assert_approved("csv", (tmp_path / "report.csv").read_text())
    written_in(RunFolder(tmp_path))
    assert {path: path.read_bytes() for path in before} == before


def test_reading_loads_no_planner(tmp_path: Path) -> None:
    """One of them prints what it has leaked when a process ends."""
    folder_of(tmp_path, *stacking_run(), described=False)
    command = [sys.executable, "-X", "importtime", "-m", "pytest", "--sim-report", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=True)
    imported = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    assert "pytest_simbench.report.files" in imported
    assert not imported & {"ompl", "ruckig", "pytest_simbench.tasks.stacking"}
    assert "leaked" not in done.stderr


def test_without_descriptions_numbers_are_plain_and_a_note_says_why(tmp_path: Path) -> None:
    (summary,) = written_in(folder_of(tmp_path, *stacking_run(), described=False)).summaries
    assert {metric.better for metric in summary.metrics} == {None}
    for text in (terminal.render_task(summary, 200), (tmp_path / "report.md").read_text()):
        assert "note: stacking: the run does not say what its metrics mean" in text


def test_markdown_tables_are_rectangular_whatever_a_message_holds() -> None:
    records = [failed("WorkerDied", "load", "a | b\n<script> `c` *d*"), *throwing_run()]
    report = render_run(Report(summarise(records, METRICS, REFERENCES)), ["a.png"])
    assert "<script>" not in report.replace("\\<", "")
    assert report.endswith("![a.png](a.png)\n")
    for table in re.findall(r"(?:^\|.*\n?)+", report, re.MULTILINE):
        bars = {len(re.findall(r"(?<!\\)\|", line)) for line in table.splitlines()}
        assert len(bars) == 1
    assert render_run(Report()) == "No repetition was recorded.\n"


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


def reading(said: TaskDescription, of: list[dict[str, Any]], **more: Any) -> RunContents:
    """A run that says one thing and holds another; both as they come from the disk."""
    said = TaskDescription.from_dict(json.loads(json.dumps(said.to_dict())))
    found = [
        record(("mujoco", "drake")[k % 2], k // 2, "task", metrics=item, seed=k // 2, **more)
        for k, item in enumerate(of)
    ]
    return RunContents("run", tuple(found), {"task": said})


@given(descriptions, values)
def test_whatever_is_said_of_whatever_numbers_is_shown(
    said: TaskDescription, of: list[dict[str, Any]]
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        summaries = Report.of(reading(said, of)).summaries
    assert_harmless_terminal(terminal.render_run(summaries, 100))
    assert_harmless_markdown(render_run(Report(summaries)))


@given(descriptions, values, values, st.booleans())
def test_whatever_is_said_is_compared_or_left_out(
    said: TaskDescription, of: list[dict[str, Any]], now: list[dict[str, Any]], percent: bool
) -> None:
    limits = [Limit(m.name, 0.05, percent) for m in said.metrics if m.better]
    before, after = reading(said, of), reading(said, now)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        report = run_gate(before.records, after.records, limits, after.metrics)
    assert_harmless_terminal(render_changes(report, 100, True))


LINE = Line("search", "t::x", "m", "headless", "tuned", "towers", 1, {}, {}, {"sentence": "0.1 mm"})


def test_repeatability_is_told_from_the_folder_too(tmp_path: Path) -> None:
    assert write_tables(tmp_path, tmp_path) == ([], [])
    append(tmp_path, LINE)
    append(tmp_path, replace(LINE, kind="guess"))
    found, problems = write_tables(tmp_path, tmp_path)
    assert [table.title for table in found] == ["Perturbation"]
    assert problems == [f"{tmp_path / 'repeatability.jsonl'}:2: not a result on repeatability"]
    assert "0.1 mm" in (tmp_path / "repeatability.md").read_text()


def test_what_cannot_be_written_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    written = write_files(tmp_path / "file" / "run", Report())
    assert not written.complete
    assert written.problems[0].startswith("no report: ")
    (tmp_path / "run" / "report.md").mkdir(parents=True)
    written = write_files(tmp_path / "run", Report(records=[record()]), figures=False)
    assert not written.complete
    assert "report.md could not be written" in written.problems[0]
    assert (tmp_path / "run" / "report.csv").exists()


def test_a_page_below_the_folder_is_told_in_short(tmp_path: Path) -> None:
    assert where(tmp_path / "run" / "a.html", tmp_path) == "report: run/a.html"
    assert where(tmp_path / "a.html", tmp_path / "run") == f"report: {tmp_path / 'a.html'}"


FINE = [record(name, k) for name in ("a", "b") for k in range(10)]
ONE_FAILED = [*FINE, failed("WorkerDied", "load", "gone", repetition=11)]


@pytest.mark.parametrize(
    ("records", "passed", "message", "colour"),
    [
        (FINE, True, "2 simulators: 20 repetitions passed", "brightgreen"),
        (FINE[:10], True, "a: 10 repetitions passed", "brightgreen"),
        (ONE_FAILED, True, "3 simulators: 1 of 21 repetitions crashed", "yellow"),
        (ONE_FAILED, False, "3 simulators: failing", "red"),
        (FINE, False, "2 simulators: failing", "red"),
        (FINE, None, "2 simulators: 20 repetitions, not judged", "lightgrey"),
        ([record(status="interrupted")], True, "nothing measured", "lightgrey"),
        ([], False, "nothing measured", "lightgrey"),
    ],
)
def test_message_and_colour_of_the_badge(
    records: list[Record], passed: bool | None, message: str, colour: str, tmp_path: Path
) -> None:
    assert write_badge(tmp_path / "new" / "badge.json", records, passed, ()) == ""
    assert json.loads((tmp_path / "new" / "badge.json").read_text()) == {
        "schemaVersion": 1,
        "label": "simulators",
        "message": message,
        "color": colour,
    }
    assert write_badge(tmp_path / "new", records, passed, ()).startswith("no badge: ")


@pytest.mark.parametrize("text", HOSTILE, ids=lambda text: ascii(text)[:20])
def test_a_name_on_a_badge_is_short_plain_text(text: str) -> None:
    message = json.loads(badge([record(text)], True, ()))["message"]
    assert_harmless_terminal(message)
    assert len(message) <= 60


def test_a_jobs_summary_is_appended_to_what_other_steps_wrote(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    assert append_summary("text") == ""
    path = tmp_path / "summary"
    monkeypatch.setenv(VARIABLE, str(path))
    assert append_summary("one ±") == append_summary("two") == ""
    assert path.read_text(encoding="utf-8") == "one ±\ntwo\n"
    size = path.stat().st_size
    assert append_summary("x" * (LARGEST - 1 - size)) == ""
    assert "larger than 1048576 bytes" in append_summary("x")
    assert path.stat().st_size == LARGEST
    monkeypatch.setenv(VARIABLE, str(tmp_path / "none" / "summary"))
    assert "cannot be written to" in append_summary("x")
