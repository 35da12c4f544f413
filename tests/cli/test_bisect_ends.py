"""The first release in which a scene's bodies end elsewhere, from planted records."""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_simbench.cli.bisect_ends import bisect_ends
from pytest_simbench.cli.search import Search
from pytest_simbench.cli.values import BadInput
from pytest_simbench.records.folder import RunFolder
from tests.approval import assert_approved_line
from tests.measure.test_settling import end

RELEASES = ("1.8", "1.9", "1.10", "1.11", "1.12")


class Recorded(Search):
    """A search in a folder that holds all runs."""

    def run(self, *places: int) -> None:
        self.ran.update({f"test_stacking[{self.named(place)}-headless]": "" for place in places})


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


def test_a_release_that_crashed_and_a_scene_that_is_missing_are_told(tmp_path: Path) -> None:
    known = search(tmp_path, 0.0, 1.0, 2.0, 3.0, 40.0)
    with pytest.raises(BadInput, match=r"1.8 and sim==2 need one end of bowl each, and have 1"):
        bisect_ends(Recorded("sim", "ends", ("1.8", "2"), known.folder, []))
    (tmp_path / "records.jsonl").write_text("")
    with pytest.raises(BadInput, match=r"no scenes were left to themselves on sim==1.8 and sim=="):
        bisect_ends(known)
