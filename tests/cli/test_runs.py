"""Runs of strangers are joined without leaving their folders or ours."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from pytest_simbench.cli.runs import merge_runs, report_runs, sections
from pytest_simbench.cli.values import BadInput
from pytest_simbench.description.carried import Carried, keep, kept
from pytest_simbench.experiment.identity import file_stem_of
from pytest_simbench.records.description import TaskDescription
from pytest_simbench.records.folder import RunContents, RunFolder
from pytest_simbench.records.record import Record
from pytest_simbench.records.repeatability import NAME
from pytest_simbench.report.files import write_outcome
from pytest_simbench.report.model.outcome import RunOutcome
from pytest_simbench.report.model.report import Report
from pytest_simbench.scene.pair_friction import OF_PAIRS
from tests.approval import assert_approved
from tests.measure import test_settling
from tests.records.build import record
from tests.report.model.test_claims import claim
from tests.report.model.test_laws import ERROR, LAWS
from tests.report.samples import METRICS
from tests.report.samples import record as stacking
from tests.report.test_whole import laws, policies, releases, scene, tasks


def saved(folder: Path, seed: int, log: str, **changes: object) -> Record:
    """A run of one repetition."""
    found = record(1, seed=seed, **changes).noting(log=log)
    RunFolder(folder).append(found)
    return found


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def merge(*runs: str) -> int:
    return merge_runs(runs, output="whole")


def test_logs_and_traces_are_copied_under_names_of_ours(here: Path) -> None:
    for name, seed in (("a", 1), ("b", 2)):
        found = saved(here / name, seed, "logs/x-1.log")
        stem = file_stem_of(found)
        for path in ("logs/x-1.log", f"traces/{stem}.npz", f"videos/{stem}.mp4"):
            file = here / name / path
            file.parent.mkdir(exist_ok=True)
            file.write_text(f"{path} of {name}")
    assert merge("a", "b") == 0
    whole = here / "whole"
    logs = [r.notes.log for r in RunFolder(whole).read().records]
    assert [(whole / log).read_text() for log in logs] == [
        "logs/x-1.log of a",
        "logs/x-1.log of b",
    ]
    assert [log[-6:] for log in logs] == ["-1.log", "-2.log"]
    for folder, ending in (("traces", ".npz"), ("videos", ".mp4")):
        copies = [Path(log.replace("logs", folder)).with_suffix(ending) for log in logs]
        assert [(whole / copy).read_text()[-4:] for copy in copies] == ["of a", "of b"]


def test_a_whole_tells_what_was_carried_of_the_scenes_of_its_parts(here: Path) -> None:
    told = Carried("geom margin", "not carried", "why"), Carried("geom gap", "not carried", "why")
    for seed, (name, account) in enumerate({"a": told, "b": told[:1], "c": told}.items(), 1):
        saved(here / name, seed, "")
        keep(here / name, here / name / "scene.xml", account)
    assert merge("a", "b", "c") == 0
    assert kept(here / "whole") == {"scene.xml": told, "b/scene.xml": told[:1]}
    assert "What was carried of scene.xml" in (here / "whole/report.html").read_text()


def test_claims_of_parts_are_not_those_of_the_whole(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "b").mkdir()
    (here / "b" / NAME).touch()
    for name, seed in (("a", 1), ("b", 2)):
        saved(here / name, seed, "")
        RunFolder(here / name).claim(claim(verdict="PASS"))
        write_outcome(here / name, RunOutcome(True))
    assert merge("a", "b") == 0
    assert RunOutcome.read(here / "whole")[0].passed is None
    told = capsys.readouterr().out
    assert told.startswith("no claim was judged; 0 of 2 repetitions crashed")
    assert "pytest --sim-resume=whole judges the claims of the whole\n" in told
    assert "b: what it found on repeatability is of that run alone\n" in told


def test_a_part_that_failed_fails_the_whole(here: Path) -> None:
    for name, seed in (("a", 1), ("b", 2)):
        saved(here / name, seed, "")
        write_outcome(here / name, RunOutcome(name == "a"))
    assert merge("a", "b") == 0
    assert RunOutcome.read(here / "whole")[0].passed is False


@pytest.mark.parametrize(
    "log",
    ["d/../../victim.log", "{victim}", "../victim.log", "logs/link.log", "out/victim.log", "logs",
     "logs/x.log\0", "/dev/zero", "logs/pipe.log"],
)  # fmt: skip
def test_a_record_leads_nowhere(here: Path, capsys: pytest.CaptureFixture[str], log: str) -> None:
    victim = here / "victim.log"
    victim.write_text("secret")
    run = here / "a"
    (run / "logs").mkdir(parents=True)
    (run / "d").mkdir()
    (run / "logs/link.log").symlink_to(victim)
    (run / "out").symlink_to(here)
    os.mkfifo(run / "logs/pipe.log")
    saved(run, 1, log.format(victim=victim))
    assert merge("a") == 0
    assert victim.read_text() == "secret"
    assert {path.name for path in here.glob("[!.]*")} == {"a", "victim.log", "whole"}
    whole = here / "whole"
    (found,) = RunFolder(whole).read().records
    assert found.notes.log == ""
    kept = {path.name for path in whole.rglob("*") if path.suffix not in (".png", "")}
    assert kept == {"records.jsonl", "outcome.json", "report.html", "report.md", "report.csv"}
    if log not in ("logs", "logs/pipe.log"):
        assert "not copied: " in capsys.readouterr().out


@pytest.mark.parametrize("link", ["logs", "records.jsonl", "tasks.jsonl", "report.md"])
def test_nothing_is_written_out_of_the_destination(here: Path, link: str) -> None:
    saved(here / "a", 1, "logs/x.log")
    (here / "a/logs").mkdir()
    (here / "a/logs/x.log").write_text("x")
    victim, whole = here / "elsewhere", here / "whole"
    victim.mkdir()
    whole.mkdir()
    (whole / link).symlink_to(victim if link == "logs" else victim / "new")
    if link in ("records.jsonl", "tasks.jsonl"):
        with pytest.raises(BadInput, match=f"'{link}' of the run .* leads out"):
            merge("a")
    else:
        assert merge("a") == 0
    assert list(victim.iterdir()) == []


def test_a_run_that_is_written_to_is_no_destination(here: Path) -> None:
    from pytest_simbench.records.lock import FolderLock

    saved(here / "a", 1, "")
    lock = FolderLock(here / "whole")
    with pytest.raises(BadInput, match="another run is under way"):
        merge("a")
    lock.close()
    (here / "whole").write_text("")
    with pytest.raises(BadInput, match="whole is a file\\); give another folder$"):
        merge("a")


def test_damaged_lines_are_told_and_the_rest_is_joined(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    saved(here / "a", 1, "")
    with (here / "a/records.jsonl").open("ab") as file:
        file.write(b"\0" * 500)
    assert merge("a") == 0
    assert "records.jsonl:2: the line is damaged and left out" in capsys.readouterr().out


def test_a_badge_that_cannot_be_written_ends_badly(here: Path) -> None:
    saved(here / "a", 1, "")
    assert merge_runs(["a"], output="whole", badge=".") == 1
    assert report_runs(["a"], badge=".") == 1
    assert report_runs(["a"], badge="badge.json") == 0
    for end in merge_runs, report_runs:  # so does a page
        (here / end.__name__ / "report.html").mkdir(parents=True)
        assert end(["a"], output=end.__name__) == 1


def test_the_same_run_by_another_name_is_given_twice(here: Path) -> None:
    saved(here / "a", 1, "")
    (here / "b").symlink_to("a")
    for other in ("b", "a/records.jsonl", "a/../a"):
        with pytest.raises(BadInput, match="the run is given twice"):
            merge("a", other)


def test_foreign_records_of_wrong_types_are_one_sentence(here: Path) -> None:
    found = saved(here / "a", 1, "")
    for change in ({"stepping": {"wall": "x"}}, {"notes": {"log": 3}}, {"seed": "1"}):
        text = json.dumps({**found.to_dict(), **change})
        (here / "a/records.jsonl").write_text(text + "\n")
        with pytest.raises(BadInput, match=r"^a: .*records.jsonl:1: '"):
            merge("a")


def test_a_mixture_is_refused(here: Path) -> None:
    first = saved(here / "a", 1, "")
    RunFolder(here / "a").append(replace(first, seed=2, repetition=2, settings={"timestep": 0.5}))
    with pytest.raises(BadInput, match="a holds several configurations: settings.timest"):
        merge("a")


def told_whole(folder: RunFolder, outcome: RunOutcome) -> None:
    for name, metrics in {**METRICS, **dict.fromkeys(LAWS, ERROR)}.items():
        folder.describe(TaskDescription(name, metrics))
    write_outcome(folder.path, outcome)
    folder.close()


@pytest.mark.parametrize("run", [tasks, laws, scene, releases, policies])
def test_all_that_is_said_of_a_run(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    run: Callable[[RunFolder], RunOutcome],
) -> None:  # fmt: skip
    monkeypatch.setenv("COLUMNS", "110")
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    folder = RunFolder(here / "a")
    told_whole(folder, run(folder))
    with (here / "a/repeatability.jsonl").open("a") as file:
        file.write("damaged\n")
    assert report_runs(["a"], record="yes") == 0
    assert_approved(f"said-{run.__name__}", capsys.readouterr().out)


def test_all_that_is_said_of_two_runs_together(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "110")
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    killed = RunOutcome(None, looks=3, ended=False, open=("test_a",))
    outcomes = RunOutcome(True, cut=("test_b",)), killed
    for name, metrics, outcome in zip("ab", ({"placed": 1.0}, {}), outcomes, strict=True):
        folder = RunFolder(here / name)
        folder.append(replace(stacking(simulator=name), metrics=metrics))
        told_whole(folder, outcome)
    with (here / "b/records.jsonl").open("a") as file:
        file.write("damaged\n")
    ends = [report_runs(["a", "b"], verbose=True, record="yes", badge="badge.json")]
    assert sorted(path.name for path in here.glob("[!.]*")) == ["a", "b", "badge.json"]
    ends += [report_runs(["b", "a"], output="both"), merge_runs(["b", "a"], output="whole")]
    texts = [(here / name).read_text() for name in ("badge.json", "whole/outcome.json")]
    assert_approved("said-together", "\n".join([capsys.readouterr().out, str(ends), *texts]))


def test_wrong_frictions_in_a_scene_are_told_once() -> None:
    """Also of a scene that has a section of its own; the whole tables tell them beside others."""
    wrong = f"{OF_PAIRS}not the scene's: of a and b it is 0.6, not 1"
    records = tuple(test_settling.end(who, 0.0, deviations=("soft", wrong)) for who in "ab")
    _, (_, text) = sections(Report.of(RunContents(records=records)), 200, False)
    assert text.count(wrong) == 1
    assert f"note: all: {wrong}" in text
    assert "soft" not in text
