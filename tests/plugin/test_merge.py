"""Runs of strangers are joined without leaving their folders or ours."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import pytest

import pytest_simbench.tasks  # noqa: F401 - pytester would import native modules a second time
from pytest_simbench.experiment.identity import file_stem_of
from pytest_simbench.plugin.merge import merge_runs
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.record import Record
from tests.records.build import record


def saved(folder: Path, seed: int, log: str, **changes: object) -> Record:
    """A run of one repetition."""
    found = record(1, seed=seed, **changes).noting(log=log)
    RunFolder(folder).append(found)
    return found


def merge(pytester: pytest.Pytester, *runs: str, output: str = "whole") -> int:
    config = pytester.parseconfig("--sim-merge", *runs, f"--sim-output={output}")
    return merge_runs(config)


def test_logs_and_traces_are_copied_under_names_of_ours(pytester: pytest.Pytester) -> None:
    for name, seed in (("a", 1), ("b", 2)):
        found = saved(pytester.path / name, seed, "logs/x-1.log")
        stem = file_stem_of(found)
        for path in ("logs/x-1.log", f"traces/{stem}.npz", f"videos/{stem}.mp4"):
            file = pytester.path / name / path
            file.parent.mkdir(exist_ok=True)
            file.write_text(f"{path} of {name}")
    assert merge(pytester, "a", "b") == 0
    whole = pytester.path / "whole"
    logs = [r.notes.log for r in RunFolder(whole).read().records]
    assert [(whole / log).read_text() for log in logs] == [
        "logs/x-1.log of a",
        "logs/x-1.log of b",
    ]
    assert [log[-6:] for log in logs] == ["-1.log", "-2.log"]
    traces = [Path(log.replace("logs", "traces")).with_suffix(".npz") for log in logs]
    assert [(whole / t).read_text()[-4:] for t in traces] == ["of a", "of b"]
    videos = [Path(log.replace("logs", "videos")).with_suffix(".mp4") for log in logs]
    assert [(whole / v).read_text()[-4:] for v in videos] == ["of a", "of b"]


@pytest.mark.parametrize(
    "log",
    ["d/../../victim.log", "{victim}", "../victim.log", "logs/link.log", "out/victim.log", "logs",
     "logs/x.log\0", "/dev/zero", "logs/pipe.log"],
)  # fmt: skip
def test_a_record_leads_nowhere(
    pytester: pytest.Pytester, capsys: pytest.CaptureFixture[str], log: str
) -> None:
    victim = pytester.path / "victim.log"
    victim.write_text("secret")
    run = pytester.path / "a"
    (run / "logs").mkdir(parents=True)
    (run / "d").mkdir()
    (run / "logs/link.log").symlink_to(victim)
    (run / "out").symlink_to(pytester.path)
    os.mkfifo(run / "logs/pipe.log")
    saved(run, 1, log.format(victim=victim))
    assert merge(pytester, "a") == 0
    assert victim.read_text() == "secret"
    assert {path.name for path in pytester.path.glob("[!.]*")} == {"a", "victim.log", "whole"}
    whole = pytester.path / "whole"
    (found,) = RunFolder(whole).read().records
    assert found.notes.log == ""
    kept = {path.name for path in whole.rglob("*") if path.suffix not in (".png", "")}
    assert kept == {"records.jsonl", "outcome.json", "report.html", "report.md", "report.csv"}
    if log not in ("logs", "logs/pipe.log"):
        assert "not copied: " in capsys.readouterr().out


@pytest.mark.parametrize("link", ["logs", "records.jsonl", "tasks.jsonl", "report.md"])
def test_nothing_is_written_out_of_the_destination(pytester: pytest.Pytester, link: str) -> None:
    saved(pytester.path / "a", 1, "logs/x.log")
    (pytester.path / "a/logs").mkdir()
    (pytester.path / "a/logs/x.log").write_text("x")
    victim = pytester.mkdir("elsewhere")
    whole = pytester.mkdir("whole")
    (whole / link).symlink_to(victim if link == "logs" else victim / "new")
    if link in ("records.jsonl", "tasks.jsonl"):
        with pytest.raises(pytest.UsageError, match=f"'{link}' of the run .* leads out"):
            merge(pytester, "a")
    else:
        assert merge(pytester, "a") == 0
    assert list(victim.iterdir()) == []


def test_a_run_that_is_written_to_is_no_destination(pytester: pytest.Pytester) -> None:
    from pytest_simbench.records.lock import FolderLock

    saved(pytester.path / "a", 1, "")
    lock = FolderLock(pytester.path / "whole")
    with pytest.raises(pytest.UsageError, match="another run is under way"):
        merge(pytester, "a")
    lock.close()


def test_damaged_lines_are_told_and_the_rest_is_joined(
    pytester: pytest.Pytester, capsys: pytest.CaptureFixture[str]
) -> None:
    saved(pytester.path / "a", 1, "")
    with (pytester.path / "a/records.jsonl").open("ab") as file:
        file.write(b"\0" * 500)
    assert merge(pytester, "a") == 0
    assert "records.jsonl:2: the line is damaged and left out" in capsys.readouterr().out


def test_the_same_run_by_another_name_is_given_twice(pytester: pytest.Pytester) -> None:
    saved(pytester.path / "a", 1, "")
    (pytester.path / "b").symlink_to("a")
    for other in ("b", "a/records.jsonl", "a/../a"):
        with pytest.raises(pytest.UsageError, match="the run is given twice"):
            merge(pytester, "a", other)


def test_foreign_records_of_wrong_types_are_one_sentence(pytester: pytest.Pytester) -> None:
    found = saved(pytester.path / "a", 1, "")
    for change in ({"stepping": {"wall": "x"}}, {"notes": {"log": 3}}, {"seed": "1"}):
        text = json.dumps({**found.to_dict(), **change})
        (pytester.path / "a/records.jsonl").write_text(text + "\n")
        with pytest.raises(pytest.UsageError, match=r"--sim-merge a: .*records.jsonl:1: '"):
            merge(pytester, "a")


def test_a_mixture_is_refused(pytester: pytest.Pytester) -> None:
    first = saved(pytester.path / "a", 1, "")
    RunFolder(pytester.path / "a").append(
        replace(first, seed=2, repetition=2, settings={"timestep": 0.5})
    )
    with pytest.raises(pytest.UsageError, match="a holds several configurations: settings.timest"):
        merge(pytester, "a")
