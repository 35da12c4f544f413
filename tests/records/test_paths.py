"""Paths of a run folder: nothing leads out of it, no file is half written."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from pytest_simbench.records.paths import FolderError, inside, new_name, opened, whole, write_whole


def test_runs_of_one_second_have_different_folders(tmp_path: Path) -> None:
    names = [new_name(tmp_path).name for _ in range(500)]
    assert len(set(names)) == 500
    assert all(name[:10].count("-") == 2 for name in names)
    pattern = r"\d{4}-\d\d-\d\d_\d\d-\d\d-\d\d-[0-9a-f]{8}"
    assert all(re.fullmatch(pattern, name) for name in names)
    assert re.fullmatch(rf"{pattern}\.part", new_name(tmp_path, ".part").name)
    assert new_name(tmp_path).parent == tmp_path


def with_links(parent: Path) -> Path:
    """A folder with links that lead out of it."""
    run = parent / "run"
    run.mkdir()
    (parent / "victim").touch()
    (run / "out").symlink_to(parent / "victim")
    (run / "through").symlink_to(parent)
    return run


@pytest.mark.parametrize(
    "name",
    ["../victim", "/etc/passwd", "a/../../victim", "out", "through/victim", "through/new", "", ".",
     "a\0b", "\ud800", "x" * 300],
)  # fmt: skip
def test_nothing_leads_out_of_a_folder(tmp_path: Path, name: str) -> None:
    run = with_links(tmp_path)
    with pytest.raises(FolderError):
        inside(run, name)


def test_what_lies_inside_is_found_also_where_the_folder_is_a_link(tmp_path: Path) -> None:
    run = tmp_path / "run"
    (run / "logs").mkdir(parents=True)
    (run / "logs" / "a.log").touch()
    (tmp_path / "link").symlink_to(run)
    for folder in (run, tmp_path / "link"):
        assert inside(folder, "logs/a.log").is_file()
        assert not inside(folder, "logs/missing.log").exists()


def test_a_file_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "report.md"
    path.symlink_to(tmp_path / "victim")
    write_whole(tmp_path, "report.md", b"new")
    assert path.read_bytes() == b"new"
    assert not (tmp_path / "victim").exists()
    (tmp_path / "folder").mkdir()
    with pytest.raises(OSError, match="directory"):
        write_whole(tmp_path, "folder", b"new")
    assert {p.name for p in tmp_path.iterdir()} == {"report.md", "folder"}
    assert os.path.isdir(tmp_path / "folder")


@pytest.mark.parametrize("name", ["report.md", "traces/x.npz"])
def test_a_link_in_the_place_of_a_temporary_file_is_not_followed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """Even where somebody has guessed its name."""
    run, victim = tmp_path / "run", tmp_path / "victim"
    (run / name).parent.mkdir(parents=True)
    victim.write_text("secret")
    monkeypatch.setattr("secrets.token_hex", lambda size: "00")
    (run / name).with_name(".00.part").symlink_to(victim)
    with pytest.raises(FileExistsError):
        write_whole(run, name, b"new")
    assert victim.read_text() == "secret"


@pytest.mark.parametrize("flags", [os.O_RDONLY, os.O_RDWR | os.O_CREAT | os.O_APPEND])
@pytest.mark.parametrize("name", ["out", "through/victim", "through/new", "../victim", "", "a\0b"])
def test_what_is_opened_lies_inside(tmp_path: Path, name: str, flags: int) -> None:
    run = with_links(tmp_path)
    with pytest.raises(OSError, match="leads out of its folder or is a link|is no file's name"):
        opened(run, name, flags)
    if name != "out":  # which would be replaced
        with pytest.raises(OSError, match="leads out|is no"), whole(run, name):
            pass
    assert {path.name for path in tmp_path.iterdir()} == {"run", "victim"}


def test_folders_are_made_for_what_is_written_alone(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        opened(tmp_path / "a", "logs/x")
    assert not (tmp_path / "a").exists()
    os.close(opened(tmp_path / "a", "logs/x", os.O_CREAT | os.O_RDWR))
    assert (tmp_path / "a/logs/x").is_file()
