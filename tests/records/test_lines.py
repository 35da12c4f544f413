"""Files of JSON lines: malformed lines, full disks, several writers."""

from __future__ import annotations

import errno
import gc
import json
import os
import subprocess
import sys
import tempfile
import weakref
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.records import lines
from pytest_simbench.records.folder import RECORDS, RunFolder
from pytest_simbench.records.lines import LARGEST_LINE, LinesFile

from ..approval import assert_approved_line
from .build import record

HERE = Path(__file__).parent


def test_a_truncated_line_is_reported_and_the_next_record_starts_its_own(tmp_path: Path) -> None:
    path = tmp_path / RECORDS
    path.write_text(record(0).to_json() + "\n" + record(1).to_json()[:-40])
    reading = RunFolder.of(path).read()
    assert [item.repetition for item in reading.records] == [0]
    assert reading.problems[0].startswith(f"{path}:2: the line is damaged and left out: not JSON (")
    RunFolder(path.parent).append(record(2))
    reading = RunFolder.of(path).read()
    assert [item.repetition for item in reading.records] == [0, 2]
    assert len(reading.problems) == 1
    path.write_bytes(b"{")  # not more than that was written
    RunFolder(path.parent).append(record(3))
    assert [item.repetition for item in RunFolder.of(path).read().records] == [3]


def test_a_full_disk_keeps_the_records_and_moves_them_elsewhere(tmp_path: Path) -> None:
    file = LinesFile(Path("/dev"), "full", tmp_path, "record")
    assert not file.append(record(0).to_json())
    assert not file.append(record(1).to_json())
    report = file.close()
    assert report.fallback is not None
    assert report.unsaved == ()
    assert [item.repetition for item in RunFolder.of(report.fallback).read().records] == [0, 1]
    assert report.problems == (
        "2 records could not be written to /dev/full (No space left on device); "
        f"they are in {report.fallback}",
    )
    assert not file.close()


def test_records_that_no_disk_takes_are_handed_back(tmp_path: Path) -> None:
    blocked = tmp_path / "a file"
    blocked.touch()
    file = LinesFile(Path("/dev"), "full", blocked, "record")
    file.append(record(0).to_json())
    report = file.close()
    assert report
    assert report.unsaved == (record(0).to_json(),)
    assert report.problems == (
        "1 record could not be written to /dev/full (No space left on device) nor to "
        f"{blocked} (File exists); they follow, one a line: save them",
    )


def test_what_cannot_be_read_is_named_with_its_reason(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for name, why in (("pipe", "it is no ordinary file"), ("none", "No such file or directory")):
        with pytest.raises(lines.UnreadableError) as told:
            lines.read(tmp_path, name, lambda data, where: data)
        assert (str(told.value), told.value.reason) == (
            f"{tmp_path / name} cannot be read ({why})", why,
        )  # fmt: skip


def test_the_system_folder_is_the_fallback(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    file = LinesFile(Path("/dev"), "full")
    file.append(record(0).to_json())
    fallback = file.close().fallback
    assert fallback.parent.parent == tmp_path


def test_records_wait_for_the_disk_and_keep_their_order(tmp_path: Path) -> None:
    parent = tmp_path / "run"
    parent.touch()  # a file where the folder should be
    file = LinesFile(parent, RECORDS)
    assert not file.append(record(0).to_json())
    assert not file.append(record(1).to_json())
    parent.unlink()
    assert file.append(record(2).to_json())
    assert [item.repetition for item in RunFolder(parent).read().records] == [0, 1, 2]
    assert not file.close()


def test_a_write_cut_short_by_a_full_disk_is_written_again(tmp_path: Path) -> None:
    """The file-size limit of a child process cuts a write short as a full disk does."""
    path = tmp_path / RECORDS
    line = len(record(0).to_json()) + 1
    code = f"""
import resource, signal, sys
from pathlib import Path
from pytest_simbench.records.lines import LinesFile
from build import record
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
file = LinesFile(Path({str(tmp_path)!r}), "{RECORDS}")
assert file.append(record(0).to_json())
resource.setrlimit(resource.RLIMIT_FSIZE, ({line + 50}, resource.RLIM_INFINITY))
assert not file.append(record(1).to_json())
resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY,) * 2)
assert not file.close()
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60, cwd=HERE)
    reading = RunFolder.of(path).read()
    assert [item.repetition for item in reading.records] == [0, 1]
    assert len(reading.problems) == 1


def test_two_processes_append_without_mixing_lines(tmp_path: Path) -> None:
    path = tmp_path / RECORDS
    code = """
import sys
from pathlib import Path
from pytest_simbench.records.lines import LinesFile
from build import record
file = LinesFile(Path(sys.argv[1]), "records.jsonl")
for k in range(150):
    assert file.append(record(k, simulator=sys.argv[2], details={"log": "x" * 20_000}).to_json())
"""
    writers = [
        subprocess.Popen([sys.executable, "-c", code, str(tmp_path), name], cwd=HERE)
        for name in ("one", "two")
    ]
    assert [writer.wait(timeout=60) for writer in writers] == [0, 0]
    reading = RunFolder.of(path).read()
    assert reading.problems == ()
    for name in ("one", "two"):
        found = [item.repetition for item in reading.records if item.simulator == name]
        assert found == list(range(150))


def test_each_record_is_on_the_disk_before_the_next_thing_happens(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What `fsync` was called on, and what the file held then."""
    path = tmp_path / RECORDS
    synced: list[int] = []
    real = os.fsync

    def fsync(descriptor: int) -> None:
        if os.path.samestat(os.fstat(descriptor), os.stat(path)):
            synced.append(len(path.read_bytes().splitlines()))
        real(descriptor)

    monkeypatch.setattr(os, "fsync", fsync)
    file = LinesFile(tmp_path, RECORDS)
    for number in (1, 2, 3):
        assert file.append(record(number).to_json())
        assert synced == list(range(1, number + 1))


@pytest.mark.parametrize(
    ("number", "written"), [(errno.EIO, False), (errno.EINVAL, True), (errno.ENOTSUP, True)]
)
def test_what_does_not_reach_the_disk_waits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, written: bool
) -> None:
    """A pipe knows of no disk."""

    def fsync(descriptor: int) -> None:
        raise OSError(number, "")

    monkeypatch.setattr(os, "fsync", fsync)
    assert LinesFile(tmp_path, RECORDS).append("{}") is written


def test_a_new_file_is_on_the_disk_by_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folders: list[bool] = []
    real = os.fsync

    def fsync(descriptor: int) -> None:
        folders.append(os.path.samestat(os.fstat(descriptor), os.stat(tmp_path)))
        real(descriptor)

    monkeypatch.setattr(os, "fsync", fsync)
    LinesFile(tmp_path, RECORDS).append("{}")
    assert True in folders


DAMAGE = {
    "NULs": b"\0" * 4096,
    "NULs and a newline": b"\0" * 100 + b"\n",
    "torn": b'{"schema": 1, "test": "t',
    "half a character": '{"test": "ä'.encode()[:-1],
    "UTF-16": '{"test": 1}\n'.encode("utf-16"),
    "random bytes": bytes(range(1, 10)) + bytes(range(11, 256)),
    "deep": b"[" * 100_000,
    "deep object": b'{"a":' * 5000,
    "not a number": b'{"test": NaN}',
    "a number without end": b'{"seed": ' + b"9" * 10_000 + b"}",
    "a list": b"[]",
    "a long line": b"x" * (LARGEST_LINE + 1000),
}


@pytest.mark.parametrize("kind", DAMAGE)
@pytest.mark.parametrize("place", ["start", "middle", "end"])
def test_damage_loses_nothing_else_and_is_repaired(tmp_path: Path, kind: str, place: str) -> None:
    lines = [record(k).to_json().encode() + b"\n" for k in range(4)]
    at = {"start": 0, "middle": 2, "end": 4}[place]
    path = tmp_path / RECORDS
    path.write_bytes(b"".join([*lines[:at], DAMAGE[kind].rstrip(b"\n") + b"\n" * (at < 4)]))
    for k in range(at, 4):
        with path.open("ab") as file:
            file.write(lines[k])
    RunFolder(path.parent).append(record(4))
    reading = RunFolder(tmp_path).read()
    assert [r.repetition for r in reading.records] == [0, 1, 2, 3, 4]
    assert reading.problems
    place, problem = reading.problems[0].split(": ", 1)
    assert place == f"{path}:{at + 1}"
    assert_approved_line("damaged", f"{kind}: {problem.partition(' (')[0]}")
    assert all(len(problem) < 400 for problem in reading.problems)
    before = path.read_bytes()
    (kept,) = RunFolder(tmp_path).repair()
    assert kept.read_bytes() == before
    assert RunFolder(tmp_path).read() == replace(reading, problems=())
    assert path.read_bytes() == b"".join([*lines, record(4).to_json().encode() + b"\n"])
    assert RunFolder(tmp_path).repair() == ()


def test_each_damaged_file_is_kept_beside_the_earlier_ones(tmp_path: Path) -> None:
    path, damaged = tmp_path / RECORDS, []
    for k in range(3):
        with path.open("ab") as file:
            file.write(b"garbage\n" + record(k).to_json().encode() + b"\n")
        damaged.append(path.read_bytes())
        RunFolder(tmp_path).repair()
    kept = [path.with_name(f"{path.name}.damaged-{number}") for number in (1, 2, 3)]
    assert [file.read_bytes() for file in kept] == damaged


@given(st.binary(max_size=40), st.integers(0, 3))
def test_any_bytes_between_records_lose_none_of_them(garbage: bytes, at: int) -> None:
    lines = [record(k).to_json().encode() + b"\n" for k in range(4)]
    lines.insert(at, garbage.replace(b"\n", b" ") + b"\n")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, RECORDS)
        path.write_bytes(b"".join(lines))
        found = RunFolder.of(path).scan()
    assert [r.repetition for r in found.every] == [0, 1, 2, 3]


def test_a_newline_that_became_nul_loses_no_record(tmp_path: Path) -> None:
    path = tmp_path / RECORDS
    path.write_bytes(b"\0\0\0".join(record(k).to_json().encode() for k in range(3)) + b"\n")
    reading = RunFolder.of(path).read()
    assert [r.repetition for r in reading.records] == [0, 1, 2]
    assert reading.problems == (f"{path}:1: the line is damaged and left out: it holds NUL bytes",)


@pytest.mark.parametrize("much", [0, 10**9], ids=["much", "little"])
def test_much_is_kept_from_the_garbage_collector_and_freed_as_ever(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, much: int
) -> None:
    """Objects of the permanent generation are no longer looked through, and go with their last
    reference."""
    monkeypatch.setattr(lines, "MUCH", much)
    path = tmp_path / "some.jsonl"
    path.write_text(json.dumps({"a": [1]}) + "\n")
    gc.unfreeze()
    found = lines.read(tmp_path, path.name, lambda data, where: Kept(data))
    assert gc.isenabled()
    assert (gc.get_freeze_count() > 0) == (much == 0)
    freed = weakref.ref(found.items[0])
    del found
    assert freed() is None
    gc.unfreeze()


def test_a_reader_that_raises_leaves_the_garbage_collector_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lines, "MUCH", 0)
    (tmp_path / "some.jsonl").write_text("{}\n")

    def broken(data: object, where: str) -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        lines.read(tmp_path, "some.jsonl", broken)
    assert gc.isenabled()
    gc.unfreeze()


class Kept:
    """What can be weakly referred to."""

    def __init__(self, data: dict[str, object]) -> None:
        self.data = data
