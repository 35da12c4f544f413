"""What a run says: `simbench.load`, tables, comparisons, frames and reports. No engine."""

from __future__ import annotations

import csv
import io
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import pytest_simbench as simbench
from pytest_simbench.cli.runs import printed
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.repeatability import Line, append
from pytest_simbench.tasks import Stacking
from tests.approval import assert_approved
from tests.records.build import record

Write = Callable[..., simbench.Run]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """A run of stacking on two engines, which place these shares of the cubes."""

    def written(name: str, first: float = 1.0, second: float = 0.5) -> simbench.Run:
        folder = RunFolder(tmp_path / name)
        folder.lock()
        folder.describe(Stacking())
        for engine, share in (("one", first), ("two", second)):
            for k in range(12):
                test = f"test_stacking[{engine}-headless]"
                value = {"placed": share - k % 3 / 100}
                folder.append(record(k, metrics=value, simulator=engine, test=test))
        folder.close()
        return simbench.load(tmp_path / name)

    return written


def test_the_table_is_what_pytest_prints(write: Write) -> None:
    run = write("run")
    text, html = str(run.table()), run.table()._repr_html_()
    assert "2 simulators did stacking: 24 repetitions, none crashed." in text
    assert html.count("<table>") == 1
    assert "placed: one 99 % [68, 100] is ahead of two 49 % [34, 65]" in html
    assert len(str(run.table(verbose=True))) > len(text)
    assert run.table(verbose=True).html.count("<table>") > 1
    assert run._repr_html_() == html
    assert repr(run) == f"<Run {run.folder}: 24 repetitions of stacking on one, two>"


def test_all_that_is_said_of_a_run(
    write: Write, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("COLUMNS", "110")
    monkeypatch.chdir(tmp_path)
    write("before"), write("run", second=0.2)
    with Path("run/records.jsonl").open("a") as file:
        file.write("half a line\n")
    run = simbench.load("run")
    shown = run.table(), run.table(verbose=True), run.compare(), run.compare("before")
    text = "\n====\n".join([*map(str, shown), shown[0].html, shown[3].html, repr(run)])
    assert_approved("api", text)


def test_html_of_a_notebook_is_escaped(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path)
    evil = "<script>alert(1)</script>"
    told = {"simulator": evil, "task": evil, "test": f"test_{evil}[x]", "reasons": (evil,)}
    folder.append(record(1, metrics={"placed": 1.0}, **told))
    folder.flush()
    run = simbench.load(tmp_path)
    for shown in (run.table(True), run.compare(), run.compare(run)):
        assert "<script" not in shown.html
        assert "&lt;script" in shown.html


def test_simulators_are_compared_with_each_other(write: Write) -> None:
    shown = write("run").compare()
    assert "the row beats the column at" in str(shown)
    assert "the row beats the column at" in shown.html
    assert "placed" in str(shown)


def test_a_run_is_compared_with_an_earlier_one(write: Write) -> None:
    before, now = write("before"), write("now", second=0.2)
    for earlier in (before, before.folder, str(before.folder / "records.jsonl")):
        text = str(now.compare(earlier))
        assert "Compared with " in text
        assert "-30 points" in text
        assert "worse" in text
    assert "not significantly more repetitions crashed" in str(now.compare(before))
    with pytest.raises(simbench.BadInput, match="there is no baseline nowhere; give a run folder"):
        now.compare("nowhere")
    with pytest.raises(
        simbench.BadInput, match="^earlier=Record.*: give a run, or the path of one$"
    ):
        now.compare(before.contents.records[0])  # type: ignore[arg-type]


def test_records_have_the_columns_of_the_csv_file(write: Write) -> None:
    run = write("run")
    columns = run.records
    assert isinstance(columns, dict)  # neither pandas nor polars is a dependency of the tests
    assert {len(column) for column in columns.values()} == {24}
    assert columns["metrics.placed"][:3] == [1.0, 0.99, 0.98]
    run.report()
    header = next(csv.reader(io.StringIO((run.folder / "report.csv").read_text())))
    assert header == list(columns)


@pytest.mark.parametrize("name", ["pandas", "polars"])
def test_records_are_a_frame_where_a_package_makes_one(
    write: Write, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    package: Any = SimpleNamespace(DataFrame=lambda columns: ("frame", columns))
    monkeypatch.setitem(sys.modules, name, package)
    monkeypatch.setattr("pytest_simbench.api.result.find_spec", lambda asked: asked == name)
    assert write("run").records[0] == "frame"


def test_the_report_is_a_page_or_all_files(write: Write, tmp_path: Path) -> None:
    """With what lies beside the records, wherever it is written."""
    run = write("run")
    asked = "search", "t", "one", "headless", "tuned", "stacking", 1, {}, {}
    append(run.folder, Line(*asked, {"sentence": "0.7 mm topples it"}))  # type: ignore[arg-type]
    for path in (run.folder, tmp_path / "new" / "mine.html", tmp_path / "all"):
        assert "0.7 mm topples it" in run.report(path).read_text("utf-8")
    assert run.report() == run.folder / "report.html"
    alone = run.report(tmp_path / "new" / "mine.html").read_text()
    assert alone.startswith("<!DOCTYPE html>")
    assert "records.jsonl, which lies beside this file" not in alone
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == ["mine.html"]
    assert run.report(tmp_path / "all") == tmp_path / "all" / "report.html"
    assert (tmp_path / "all" / "report.md").is_file()
    (tmp_path / "file").touch()
    for path in (tmp_path / "file" / "page.html", tmp_path / "file"):
        with pytest.raises(simbench.BadInput, match="file"):
            run.report(path)
    with pytest.raises(simbench.BadInput, match="^path=7: give the path of a page or of a folder$"):
        run.report(7)  # type: ignore[arg-type]


def test_a_folder_that_is_no_run_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(simbench.BadInput, match=r"give a run folder or its records\.jsonl$"):
        simbench.load(tmp_path / "none")
    (tmp_path / "records.jsonl").touch()
    with pytest.raises(simbench.BadInput, match="it holds no repetition"):
        simbench.load(tmp_path)
    (tmp_path / "records.jsonl").write_text("no JSON\n")
    with pytest.raises(simbench.BadInput, match="records.jsonl:1: not JSON"):
        simbench.load(tmp_path)
    with pytest.raises(simbench.BadInput, match="^folder=None: give the path of a run$"):
        simbench.load(None)  # type: ignore[arg-type]


def test_what_is_damaged_is_told(write: Write) -> None:
    run, other = write("run"), write("other")
    with (run.folder / "records.jsonl").open("a") as file:
        file.write("half a line\n")
    damaged = simbench.load(run.folder)
    assert "damaged" in str(damaged.table())
    for shown in (other.compare(run.folder), other.compare(damaged), damaged.compare(other)):
        assert " ".join(str(shown).split()).count("damaged and left out") == 1
        assert "damaged and left out" in shown.html


def test_a_notebook_rewrites_the_line_of_progress(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    stream = type("OutStream", (io.StringIO,), {"__module__": "ipykernel.iostream"})()
    monkeypatch.setattr(sys, "stdout", stream)
    progress = printed()
    progress.start_test("test_falling[x]", 2)
    progress.end_test()
    assert stream.getvalue().startswith("\rtest_falling[x]  0 of 2 repetitions done")
    assert stream.getvalue().endswith("\r")
    before = stream.getvalue()
    printed(quiet=True).start_test("t", 1)
    assert stream.getvalue() == before
