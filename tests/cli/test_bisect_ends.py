"""The first release in which a scene's bodies end elsewhere, from planted records."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from pytest_simbench.cli.bisect_ends import bisect_ends
from pytest_simbench.cli.search import Search
from pytest_simbench.cli.values import BadInput
from pytest_simbench.records.folder import RunFolder
from tests.approval import assert_approved_line
from tests.measure.test_settling import at, crashed, end

RELEASES = ("1.8", "1.9", "1.10", "1.11", "1.12")


class Recorded(Search):
    """A search in a folder that holds all runs."""

    def run(self, *places: int) -> None:
        self.ran.update({f"test_stacking[{self.named(place)}-headless]": "" for place in places})


JUNIT = """<testsuite>
<testcase classname="test_a" name="test_x[sim==1.9]"><properties>
<property name="falling 1: repetitions" value="3"/></properties></testcase>
<testcase classname="test_a" name="test_y"/><testcase classname="b" name="c"><properties/>
<skipped message="not here&#10;at all"/></testcase></testsuite>"""


@pytest.mark.parametrize(("folder", "keep"), [("new", "--sim-output"), ("old", "--sim-resume")])
def test_what_a_run_is_asked_and_what_is_kept_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: str, keep: str
) -> None:
    asked: list[list[str]] = []
    ended = SimpleNamespace(returncode=1, stdout="")

    def run(command: list[str], **options: Any) -> Any:
        asked.append(command)
        place = next(w for w in command if w.startswith("--junitxml=")).partition("=")[2]
        Path(place).write_text(JUNIT)
        return ended

    monkeypatch.setattr("pytest_simbench.cli.search.subprocess.run", run)
    (tmp_path / "old").mkdir()
    (tmp_path / "old/records.jsonl").write_text("{}\n")
    one = Search("sim", "landed", RELEASES, tmp_path / folder, ["test_a.py", "--reps=3"])
    one.run(1, 4)
    (words,) = asked
    assert words[:3] == [sys.executable, "-m", "pytest"]
    assert [w for w in words[3:] if "junitxml" not in w] == [
        "test_a.py", "--reps=3", f"{keep}={tmp_path / folder}", "--sim-name=sim==1.9,sim==1.12",
        "--sim-install-missing", "-q", "--junitprefix=",
    ]  # fmt: skip
    assert one.ran == {
        "test_a.test_x[sim==1.9]": "", "test_a.test_y": "it repeats no task", "b.c": "not here",
    }  # fmt: skip
    lost = (
        '<testcase name="t"><failure message="Failed: t is not resumed, since&#10;x"/></testcase>'
    )
    monkeypatch.setitem(globals(), "JUNIT", lost)
    with pytest.raises(BadInput):
        one.run(1)
    ended.returncode, ended.stdout = 4, "a\n\nb\n  \nc\nERROR: no"
    with pytest.raises(BadInput):
        one.run(1, 2)


def search(folder: Path, *ends: float, moved: float | None = None) -> Search:
    """The bowl ends there [mm] in each release; by so much elsewhere where its start is moved."""
    run = RunFolder(folder)
    for release, x in zip(RELEASES, ends, strict=True):
        run.append(end(f"sim=={release}", x))
        if moved is not None:
            run.append(end(f"sim=={release}", x + moved, moved=1e-4))
    return Recorded("sim", "ends", RELEASES, folder, [])


def test_the_first_release_that_ends_elsewhere(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert bisect_ends(search(tmp_path, 0.0, 0.4, 30.0, 31.0, 30.5, moved=2.0)) == 0
    told = capsys.readouterr().out.replace(f"{tmp_path}", "DIR")
    assert_approved_line("bisect", told.replace("\n", " | "))
    assert "1.11 ends 31 mm from 1.8" not in told  # halving does not ask it


def test_one_that_ends_halfway_is_good(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert bisect_ends(search(tmp_path / "a", 0.0, 0.0, 16.0, 32.0, 32.0, moved=0.0)) == 0
    told = capsys.readouterr().out.replace(f"{tmp_path}", "DIR")
    assert_approved_line("bisect", told.replace("\n", " | "))


@pytest.mark.parametrize(
    ("last", "moved"),
    [(30.5, 40.0), (30.5, None), (0.9, None)],  # of the last what lies between is not asked
)
def test_what_has_no_cause(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], last: float, moved: float | None
) -> None:
    assert bisect_ends(search(tmp_path, 0.0, 0.4, 30.0, 31.0, last, moved=moved)) == 1
    told = capsys.readouterr().out.replace(f"{tmp_path}", "DIR")
    assert_approved_line("bisect", told.replace("\n", " | "))
    assert ("first release" in told) == (last > 1)


def test_a_release_whose_moved_starts_crashed_is_no_cause(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    known = search(tmp_path, 0.0, 0.4, 30.0, 31.0, 30.5)
    for release in RELEASES:
        RunFolder(tmp_path).append(crashed(f"sim=={release}", moved=1e-4))
    assert bisect_ends(known) == 1
    assert "No moved start ended in both, so nobody knows" in capsys.readouterr().out


def test_a_release_that_crashed_and_a_scene_that_is_missing_are_told(tmp_path: Path) -> None:
    known = search(tmp_path, 0.0, 1.0, 2.0, 3.0, 40.0)
    with pytest.raises(BadInput, match=r"1.8 and sim==2 need one end of bowl each, and have 1"):
        bisect_ends(Recorded("sim", "ends", ("1.8", "2"), known.folder, []))
    (tmp_path / "records.jsonl").write_text("")
    with pytest.raises(BadInput, match=r"no scenes were left to themselves on sim==1.8 and sim=="):
        bisect_ends(known)


def test_releases_that_ended_from_different_starts_are_not_told_apart(tmp_path: Path) -> None:
    for seed, release in ((2, "1"), (3, "2")):
        RunFolder(tmp_path).append(at(f"sim=={release}", seed, 0.0))
    with pytest.raises(BadInput, match="no start ended in each of sim==1 and sim==2"):
        bisect_ends(Recorded("sim", "ends", ("1", "2"), tmp_path, []))
