"""Records of a stranger: whatever their texts hold, every writer shows texts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import matplotlib
import pytest

from pytest_simbench.measure.gate import run_gate
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.notes import Notes
from pytest_simbench.records.record import Failure, Record
from pytest_simbench.records.repeatability import Line
from pytest_simbench.report.files import csv_of, write_files
from pytest_simbench.report.markdown.run import render_run as markdown
from pytest_simbench.report.markdown.run import render_section, table
from pytest_simbench.report.markdown.run import render_tables as tables_in_markdown
from pytest_simbench.report.model import changes, repeatability
from pytest_simbench.report.model.capabilities import columns
from pytest_simbench.report.model.report import Report
from pytest_simbench.report.model.summary import TaskSummary, summarise
from pytest_simbench.report.terminal.grid import render
from pytest_simbench.report.terminal.parts import render_changes, render_tables
from pytest_simbench.report.terminal.progress import Progress
from pytest_simbench.report.terminal.run import render_brief, render_run
from pytest_simbench.simulator.registry import adapter
from tests.hostile import (
    HOSTILE,
    assert_harmless_csv,
    assert_harmless_markdown,
    assert_harmless_terminal,
)

from .samples import record

texts = pytest.mark.parametrize("text", HOSTILE, ids=lambda text: ascii(text)[:20])
ALL = "".join(HOSTILE)


def records(text: str) -> list[Record]:
    """Two rows, one of them failing, with `text` wherever a record has one."""
    found = []
    for number in range(1, 7):
        own = record(repetition=number, seed=number)
        found.append(
            replace(
                own,
                test=f"t.py::{text}",
                task=text,
                simulator=text,
                mode=text,
                profile=text,
                protocol=text,
                metrics={text: number / 10},
                deviations=(text,),
                notes=Notes(log=text, untested=text),
                settings={text: text},
                versions={text: f"{text}{number}"},
                host={text: text},
                contended=True,
                status="failed" if number > 3 else "ok",
                error=Failure(text, text, text, text) if number > 3 else None,
            )
        )
        found.append(replace(found[-1], simulator="other", metrics={text: 1.0 + number}))
    return found


def declared(text: str) -> dict[str, list[Metric]]:
    return {text: [Metric(text, text, text, study=True, doc=text)]}


def told(text: str) -> list[TaskSummary]:
    return summarise(records(text), declared(text), {text: {text: 0.5}})


@texts
def test_the_terminal_the_report_in_markdown_and_the_csv(text: str) -> None:
    found = told(text)
    for width in (60, 200):
        for shown in (render_run(found, width), render_brief(found, width)):
            assert_harmless_terminal(shown)
            assert len(shown) < 100_000
    assert_harmless_markdown(markdown(Report(found)))
    assert_harmless_terminal(markdown(Report(found)))
    content = csv_of(records(text))
    assert_harmless_csv(content)
    assert_harmless_terminal(content.replace("\r\n", "\n"))


@pytest.mark.parametrize("text", [ALL, "../../evil", "/tmp/evil", ".."])
def test_pictures_stay_in_their_folder(text: str, tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "run"
    folder.mkdir(parents=True)
    all_ = [*records(text), *(replace(r, task=f"{text} ") for r in records(text))]
    with matplotlib.rc_context({"text.parse_math": True}):
        write_files(folder, Report(summarise(all_, declared(text)), all_))
    files = {path for path in tmp_path.rglob("*") if path.is_file()}
    assert {path.parent for path in files} == {folder}
    assert sum(path.suffix == ".png" for path in files) == 6
    report = (folder / "report.md").read_text(encoding="utf-8")
    assert_harmless_markdown(report.partition("## Pictures")[0])


def test_a_formula_in_a_label_is_no_formula(tmp_path: Path) -> None:
    found = records(r"$\nonsense{$")
    report = Report(summarise(found, declared(r"$\nonsense{$")), found)
    assert write_files(tmp_path, report).problems == []


@texts
def test_the_comparison_with_a_baseline(text: str) -> None:
    now = [replace(r, versions={text: "2"}, settings={text: 1}) for r in records(text)]
    report = run_gate(records(text), now, (), declared(text))
    assert_harmless_terminal(render_changes(report, 100, True))
    assert_harmless_markdown(render_section(changes.section(text, report)))


@texts
def test_the_tables_of_repeatability(text: str) -> None:
    again = {
        "way": text, "identical": False, "first": 1.0, "body": text, "growth": {"1": 1.0},
        "largest": 1.0, "changed": [text], "left_at": None, "skipped": "", "failure": "",
        "claimed": True,
    }  # fmt: skip
    lines = [
        Line("replay", text, text, text, text, text, 1, {}, {}, {"claims": True, "again": [again]}),
        Line("search", text, text, text, text, text, 1, {}, {}, {"sentence": text}),
    ]
    found = repeatability.tables(lines, [])
    assert_harmless_terminal(render_tables(found, 100))
    assert_harmless_markdown(tables_in_markdown("Repeatability", found))


@texts
def test_the_table_of_simulators(text: str) -> None:
    info = replace(adapter("mujoco").info, name=text, title=text, licence=text, engine=text)
    assert_harmless_terminal(render(columns([info]), 100))
    assert_harmless_markdown(table(columns([info])))


@texts
@pytest.mark.parametrize("is_tty", [True, False])
def test_the_progress_line(text: str, is_tty: bool) -> None:
    written: list[str] = []
    progress = Progress(written.append, is_tty=is_tty, width=100, clock=lambda: float(len(written)))
    progress.start_test(text, 2)
    progress.repetition(1, 1)
    progress.phase(text)
    progress.count(1, 2, text)
    progress.end_repetition(text, 1.0)
    assert_harmless_terminal(progress.line())
    progress.end_test()
    for part in written:
        assert_harmless_terminal(part.replace("\r", ""))
