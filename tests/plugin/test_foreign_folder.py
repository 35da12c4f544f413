"""A run folder of somebody else: nothing outside of it is read or written through it."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from pytest_simbench.recordings.film import Film
from pytest_simbench.records.folder import TASKS, RunFolder
from pytest_simbench.report.files import write_files
from pytest_simbench.report.model.report import Report
from tests.cli.command import simbench
from tests.plugin.inner import CLAIMING, run_pytest
from tests.records.build import record

pytest.importorskip("av", reason="videos need the extra 'video'")

KEEP = ("--sim-trace=on", "--sim-record=mcap", "--sim-pictures", "--sim-video=on")


def content(folder: Path) -> dict[str, bytes]:
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def test_links_in_a_run_folder_are_not_followed(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All that a run leaves lies elsewhere, behind links; it is resumed and reported."""
    monkeypatch.setenv("TMPDIR", str(pytester.mkdir("spare")))
    pytester.makepyfile(CLAIMING)
    run_pytest(pytester, "--sim=mujoco --reps=1 --sim-output=o", *KEEP)
    run, elsewhere = pytester.path / "o", pytester.mkdir("elsewhere")
    for name in ("repeatability.jsonl", "thresholds.jsonl"):
        (run / name).touch()
    (run / "repeatability").mkdir()
    names = {path.name for path in run.iterdir()} - {"records.jsonl"}
    assert names >= {"tasks.jsonl", "thresholds.jsonl", "logs", "traces", "pictures", "videos"}
    for name in names:
        (run / name).rename(elsewhere / name)
        (run / name).symlink_to(elsewhere / name)
    before = content(elsewhere)
    resumed = run_pytest(pytester, "--sim=mujoco --reps=2 --sim-resume=o", *KEEP, passed=1)
    reported = simbench(pytester, "report", "o", "--record=mcap")
    assert content(elsewhere) == before
    assert len((run / "records.jsonl").read_text().splitlines()) == 2
    assert not (run / "report.html").is_symlink()
    for result in (resumed, reported):
        said = result.stdout.str() + result.stderr.str()
        assert "Traceback" not in said
        assert "INTERNALERROR" not in said
        assert "leads out of its folder or is a link" in said


def test_a_report_writes_through_no_temporary_name(tmp_path: Path) -> None:
    """Links of the names that this process once gave to its temporary files."""
    run, victim = RunFolder(tmp_path / "run"), tmp_path / "victim"
    run.append(record(1))
    (tmp_path / "run" / TASKS).write_text("garbage\n")
    victim.write_text("secret")
    names = ("report.html", "report.md", "report.csv", "records.jsonl", "tasks.jsonl", "x.mp4")
    for name in names:
        for part in (f".{name}.{os.getpid()}.part", f"{name}.{os.getpid()}.part", f".{name}.part"):
            (tmp_path / "run" / part).symlink_to(victim)
    assert write_files(run.path, Report.of(run.read())).complete
    assert run.repair()
    film = Film(tmp_path / "run", "x.mp4")
    film.take(0.0, np.zeros((36, 48, 3), np.uint8))
    film.finish()
    assert film.problem == ""
    assert victim.read_text() == "secret"
