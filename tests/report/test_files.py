"""The files of a run: Markdown, CSV, pictures."""

from __future__ import annotations

import csv
import io
import re
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from pytest_simbench.report import files
from pytest_simbench.report.figures.task import FiguresUnavailable, draw, drawing, write_figures
from pytest_simbench.report.files import Written, csv_of, write_files
from pytest_simbench.report.markdown import run as markdown
from pytest_simbench.report.model.matrix import with_differences
from pytest_simbench.report.model.summary import summarise

from .samples import METRICS, REFERENCES, failed, record, stacking_run, throwing_run, two_errors


def test_markdown_tables_hold_one_line_per_row() -> None:
    (summary,) = with_differences(
        summarise(stacking_run(), METRICS, ends=two_errors), stacking_run()
    )
    lines = markdown.render_task(summary).splitlines()
    assert lines[0] == "## stacking: 20 repetitions each, protocol fast"
    assert lines[2] == (
        "- placed: mujoco 99 % [97, 100] is ahead of pybullet 65 % [52, 78], "
        "by 33.3 points [16.7, 50]."
    )
    assert lines[6:10] == [
        "| simulator | crashed | placed % | at the end % | CPU % | RAM MB | x real time "
        "| CPU s/sim s | start s | end s |",
        "| :-- | --: | --: | --: | --: | --: | --: | --: | --: | --: |",
        "| mujoco headless tuned | 0 of 20 [0, 17] % "
        "| 93 / 99 / 100 [97, 100] | 87 / 97 / 100 [94, 99] "
        "| 99 +- 3 [99, 99] | 150 +- 2 [150, 150] (peak 161) "
        "| 20 [20, 20] | 0.048 [0.048, 0.048] | 0.80 [0.80, 0.80] | 9.8 [9.8, 9.8] |",
        "| pybullet headless tuned | 3 of 20 [3, 38] % "
        "| 0 / 65 / 87 [52, 78] | 0 / 77 / 100 [62, 92] "
        "| 99 +- 3 [99, 99] | 150 +- 2 [150, 150] (peak 161) "
        "| 20 [20, 20] | 0.048 [0.048, 0.048] | 0.80 [0.80, 0.80] | 9.8 [9.8, 9.8] |",
    ]


def test_markdown_tables_are_rectangular_whatever_a_message_holds() -> None:
    records = [failed("WorkerDied", "load", "a | b\n<script> `c` *d*"), *throwing_run()]
    report = markdown.render_run(summarise(records, METRICS, REFERENCES), ["a.png"])
    assert "<script>" not in report.replace("\\<", "")
    assert report.endswith("![a.png](a.png)\n")
    for table in re.findall(r"(?:^\|.*\n?)+", report, re.MULTILINE):
        bars = {len(re.findall(r"(?<!\\)\|", line)) for line in table.splitlines()}
        assert len(bars) == 1


def test_markdown_of_nothing() -> None:
    assert markdown.render_run([]) == "No repetition was recorded.\n"


def test_a_picture_of_means_tells_what_failed() -> None:
    pytest.importorskip("matplotlib", reason="pictures need the extra 'figures'")
    lost = [failed("WorkerHung", "load", "no answer", simulator="drake", repetition=1)]
    (summary,) = summarise([*stacking_run(), *lost], METRICS, ends=two_errors)
    with drawing():
        (axis, *_) = draw(summary, "metrics").axes
        labels = [label.get_text() for label in axis.get_yticklabels()]
        (times,) = draw(summary, "times").axes
    assert labels == ["drake\n1 of 1 crashed", "mujoco", "pybullet\n3 of 20 crashed"]
    assert [label.get_text() for label in times.get_yticklabels()] == ["mujoco", "pybullet"]


def test_csv_has_one_line_per_repetition() -> None:
    records = [
        record(metrics={"placed": 0.8, "at_end": None}),
        failed("WorkerHung", "settle", "no answer", repetition=2),
    ]
    first, second = csv.DictReader(io.StringIO(csv_of(records), newline=""))
    assert (first["simulator"], first["repetition"], first["seed"]) == ("mujoco", "1", "1001")
    assert (first["metrics.placed"], first["metrics.at_end"]) == ("0.8", "")
    assert (first["cost.rtf"], first["seconds.step"], first["error.type"]) == ("20.0", "8.0", "")
    assert (second["status"], second["error.type"]) == ("failed", "WorkerHung")
    assert second["error.message"] == "no answer"


def test_report_folder(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="pictures need the extra 'figures'")
    records = stacking_run() + throwing_run()
    assert write_files(tmp_path, summarise(records, METRICS, REFERENCES), records) == Written()
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "report.csv",
        "report.html",
        "report.md",
        "stacking_metrics.png",
        "stacking_resources.png",
        "stacking_times.png",
        "throwing_metrics.png",
        "throwing_resources.png",
        "throwing_times.png",
    ]
    report = (tmp_path / "report.md").read_text()
    for picture in tmp_path.glob("*.png"):
        head = picture.read_bytes()[:24]
        width, height = struct.unpack(">II", head[16:24])
        assert head.startswith(b"\x89PNG")
        assert 600 < width < 3000
        assert 150 < height < 2000
        assert f"]({picture.name})" in report


def test_only_failures_draw_no_picture(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="pictures need the extra 'figures'")
    summaries = summarise([failed("WorkerDied", "load", "gone")], METRICS)
    assert write_figures(tmp_path, summaries) == []


def test_without_matplotlib_one_line_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == "matplotlib"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    records = throwing_run()
    summaries = summarise(records, METRICS)
    with pytest.raises(FiguresUnavailable, match=r"pip install 'pytest-simbench\[figures\]'"):
        write_figures(tmp_path, summaries)
    written = write_files(tmp_path, summaries, records)
    assert written.complete
    (line,) = written.problems
    assert line.startswith("no pictures: matplotlib is missing")
    assert (tmp_path / "report.md").exists()
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "no pictures: matplotlib is missing; pip install" in page
    assert '<figure class="picture">' not in page
    assert not list(tmp_path.glob("*.png"))


def test_a_fault_of_the_drawing_costs_the_pictures_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> list[Path]:
        raise ValueError("no logarithm")

    monkeypatch.setattr(files.sweep, "write_pictures", broken)
    records = throwing_run()
    written = write_files(tmp_path, summarise(records, METRICS), records)
    assert written.problems == ("the pictures could not be drawn: ValueError: no logarithm",)
    assert not written.complete
    assert (tmp_path / "report.md").exists()
    assert (tmp_path / "report.html").exists()


def test_what_draws_and_writes_is_imported_only_then() -> None:
    code = (
        "import sys, pytest_simbench.report.files, pytest_simbench.report.terminal.run;"
        "print('matplotlib' in sys.modules, 'jinja2' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False False"
