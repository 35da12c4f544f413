"""Records and their file: round trip, malformed lines, full disks, several writers."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.records.record_file import (
    LARGEST_LINE,
    RECORDS_NAME,
    Failure,
    Reading,
    Record,
    RecordError,
    RecordFile,
    read_records,
    repair,
    scan,
)

from .build import failed, record

HERE = Path(__file__).parent

names = st.text(max_size=8)
numbers = st.floats(allow_nan=False, allow_infinity=False)
json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | numbers | names,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(names, inner, max_size=3),
    max_leaves=6,
)
any_record = st.builds(
    Record,
    test=names,
    task=names,
    simulator=names,
    mode=names,
    profile=names,
    repetition=st.integers(min_value=0),
    seed=st.integers(min_value=0),
    status=st.sampled_from(["ok", "failed", "interrupted"]),
    jitter=st.floats(min_value=0, allow_nan=False, allow_infinity=False),
    error=st.none() | st.builds(Failure, st.text(min_size=1), names, names, st.text()),
    metrics=st.dictionaries(names, st.none() | numbers, max_size=4),
    details=st.dictionaries(names, json_values, max_size=3),
    settings=st.dictionaries(names, json_values, max_size=3),
    seconds=st.dictionaries(names, numbers, max_size=3),
    deviations=st.lists(names, max_size=2).map(tuple),
    contended=st.booleans(),
)


@given(any_record)
def test_a_record_survives_the_round_trip(found: Record) -> None:
    line = found.to_json()
    assert "\n" not in line
    assert line.isascii()
    assert Record.from_json(line) == found


@given(any_record)
def test_a_line_cut_anywhere_is_never_taken_for_a_record(found: Record) -> None:
    line = found.to_json()
    for end in {1, len(line) // 3, len(line) // 2, len(line) - 1}:
        with pytest.raises(RecordError):
            Record.from_json(line[:end])


def test_keys_of_a_newer_plugin_are_kept() -> None:
    line = json.dumps({**record().to_dict(), "weather": "rain"})
    found = Record.from_json(line)
    assert found.extra == {"weather": "rain"}
    assert json.loads(found.to_json())["weather"] == "rain"


def test_numpy_values_nan_and_infinity_become_json() -> None:
    found = record(
        metrics={"placed": np.float64(0.5), "hit": np.bool_(True), "x": float("nan")},  # type: ignore[dict-item]
        details={"path": Path("a/b"), "poses": np.eye(2), "seed": np.int64(3), "far": float("inf")},
    )
    data = json.loads(found.to_json())
    assert data["metrics"] == {"placed": 0.5, "hit": True, "x": None}
    assert data["details"] == {"path": "a/b", "poses": [[1, 0], [0, 1]], "seed": 3, "far": None}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seed": "7"}, "'seed' must be int, not str"),
        ({"repetition": True}, "'repetition' must be int, not bool"),
        ({"metrics": None}, "'metrics' must be dict, not NoneType"),
        ({"metrics": {"placed": "many"}}, "metric 'placed' must be a number, not 'many'"),
        ({"status": "fine"}, "status 'fine' is none of ok, failed, interrupted"),
        ({"error": {"message": "x"}}, "'error' has no 'type'"),
        ({"schema": 99}, "schema 99 was written by a newer pytest-simbench"),
    ],
)
def test_a_wrong_value_is_named_with_file_and_line(
    change: dict[str, Any], message: str, tmp_path: Path
) -> None:
    path = tmp_path / RECORDS_NAME
    wrong = json.dumps({**record().to_dict(), **change})
    path.write_text(record().to_json() + "\n" + wrong + "\n")
    with pytest.raises(RecordError) as caught:
        read_records(path)
    assert str(caught.value).startswith(f"{path}:2: {message}")


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("[1, 2]", "a record is a JSON object, not list"),
        ("hello", "not JSON"),
        ("{} x", "not JSON"),
    ],
)
def test_a_line_that_is_no_record_is_named(line: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / RECORDS_NAME
    path.write_text(line + "\n")
    with pytest.raises(RecordError, match=message) as caught:
        read_records(tmp_path)
    assert f"{path}:1" in str(caught.value)


def test_a_missing_key_is_named() -> None:
    data = record().to_dict()
    del data["simulator"]
    with pytest.raises(RecordError, match="the record has no 'simulator'"):
        Record.from_dict(data)


def test_a_missing_file_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="No such file or directory"):
        read_records(tmp_path)


def test_appended_records_are_read_back(tmp_path: Path) -> None:
    path = tmp_path / "run" / RECORDS_NAME
    file = RecordFile(path)
    written = [record(0), failed(1), record(2)]
    assert all(file.append(item) for item in written)
    assert path.read_bytes().count(b"\n") == 3  # on the disk before closing
    assert not file.close()
    assert read_records(path.parent).records == tuple(written)


def test_a_truncated_line_is_reported_and_the_next_record_starts_its_own(tmp_path: Path) -> None:
    path = tmp_path / RECORDS_NAME
    path.write_text(record(0).to_json() + "\n" + record(1).to_json()[:-40])
    reading = read_records(path)
    assert [item.repetition for item in reading.records] == [0]
    assert reading.problems[0].startswith(f"{path}:2: the line is damaged and left out: not JSON (")
    RecordFile(path).append(record(2))
    reading = read_records(path)
    assert [item.repetition for item in reading.records] == [0, 2]
    assert len(reading.problems) == 1


def test_a_line_written_twice_counts_once(tmp_path: Path) -> None:
    path = tmp_path / RECORDS_NAME
    for _ in range(2):
        RecordFile(path).append(record(5))
    assert len(read_records(path).records) == 1


def test_a_full_disk_keeps_the_records_and_moves_them_elsewhere(tmp_path: Path) -> None:
    file = RecordFile("/dev/full", fallback=tmp_path)
    assert not file.append(record(0))
    assert not file.append(record(1))
    assert file.pending == 2
    report = file.close()
    assert report.fallback is not None
    assert report.unsaved == ()
    assert [item.repetition for item in read_records(report.fallback).records] == [0, 1]
    assert report.problems == (
        "2 records could not be written to /dev/full (No space left on device); "
        f"they are in {report.fallback}",
    )
    assert not file.close()


def test_records_that_no_disk_takes_are_handed_back(tmp_path: Path) -> None:
    blocked = tmp_path / "a file"
    blocked.touch()
    file = RecordFile("/dev/full", fallback=blocked)
    file.append(record(0))
    report = file.close()
    assert report
    assert report.unsaved == (record(0).to_json(),)
    assert "(File exists)" in report.problems[0]


def test_the_system_folder_is_the_fallback(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    file = RecordFile("/dev/full")
    file.append(record(0))
    fallback = file.close().fallback
    assert fallback is not None
    assert fallback.parent == tmp_path


def test_records_wait_for_the_disk_and_keep_their_order(tmp_path: Path) -> None:
    parent = tmp_path / "run"
    parent.touch()  # a file where the folder should be
    file = RecordFile(parent / RECORDS_NAME)
    assert not file.append(record(0))
    assert not file.append(record(1))
    parent.unlink()
    assert file.append(record(2))
    assert [item.repetition for item in read_records(parent).records] == [0, 1, 2]
    assert not file.close()


def test_a_write_cut_short_by_a_full_disk_is_written_again(tmp_path: Path) -> None:
    """The file-size limit of a child process cuts a write short as a full disk does."""
    path = tmp_path / RECORDS_NAME
    line = len(record(0).to_json()) + 1
    code = f"""
import resource, signal, sys
from pytest_simbench.records.record_file import RecordFile
from build import record
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
file = RecordFile({str(path)!r})
assert file.append(record(0))
resource.setrlimit(resource.RLIMIT_FSIZE, ({line + 50}, resource.RLIM_INFINITY))
assert not file.append(record(1)) and file.pending == 1
resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY,) * 2)
assert not file.close()
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60, cwd=HERE)
    reading = read_records(path)
    assert [item.repetition for item in reading.records] == [0, 1]
    assert len(reading.problems) == 1


def test_two_processes_append_without_mixing_lines(tmp_path: Path) -> None:
    path = tmp_path / RECORDS_NAME
    code = """
import sys
from pytest_simbench.records.record_file import RecordFile
from build import record
file = RecordFile(sys.argv[1])
for k in range(150):
    assert file.append(record(k, simulator=sys.argv[2], details={"log": "x" * 20_000}))
"""
    writers = [
        subprocess.Popen([sys.executable, "-c", code, str(path), name], cwd=HERE)
        for name in ("one", "two")
    ]
    assert [writer.wait(timeout=60) for writer in writers] == [0, 0]
    reading = read_records(path)
    assert reading.problems == ()
    for name in ("one", "two"):
        found = [item.repetition for item in reading.records if item.simulator == name]
        assert found == list(range(150))


def test_costs_are_read_from_the_record() -> None:
    found = record()
    assert found.cost("rtf") == 17.5
    assert found.cost("cpu_cost") == pytest.approx(7.9 / 140)
    assert (found.cost("cpu"), found.cost("ram"), found.cost("ram_peak")) == (99, 150, 161)
    assert (found.cost("start"), found.cost("end"), found.cost("total")) == (1.2, 9.0, 9.5)
    bare = record(stepping={"wall": 0.0, "simulated": 1.0}, resources={}, timeline={}, seconds={})
    assert all(bare.cost(name) is None for name in ("rtf", "cpu", "ram", "ram_peak", "start"))


def test_each_record_is_on_the_disk_before_the_next_thing_happens(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What `fsync` was called on, and what the file held then."""
    path = tmp_path / RECORDS_NAME
    synced: list[int] = []
    real = os.fsync

    def fsync(descriptor: int) -> None:
        if os.path.samestat(os.fstat(descriptor), os.stat(path)):
            synced.append(len(path.read_bytes().splitlines()))
        real(descriptor)

    monkeypatch.setattr(os, "fsync", fsync)
    file = RecordFile(path)
    for number in (1, 2, 3):
        assert file.append(record(number))
        assert synced == list(range(1, number + 1))


def test_a_new_file_is_on_the_disk_by_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folders: list[bool] = []
    real = os.fsync

    def fsync(descriptor: int) -> None:
        folders.append(os.path.samestat(os.fstat(descriptor), os.stat(tmp_path)))
        real(descriptor)

    monkeypatch.setattr(os, "fsync", fsync)
    RecordFile(tmp_path / RECORDS_NAME).append(record(1))
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
    path = tmp_path / RECORDS_NAME
    path.write_bytes(b"".join([*lines[:at], DAMAGE[kind].rstrip(b"\n") + b"\n" * (at < 4)]))
    for k in range(at, 4):
        with path.open("ab") as file:
            file.write(lines[k])
    RecordFile(path).append(record(4))
    reading = read_records(tmp_path)
    assert [r.repetition for r in reading.records] == [0, 1, 2, 3, 4]
    assert reading.problems
    assert reading.problems[0].startswith(f"{path}:{at + 1}: the line is damaged and left out: ")
    assert all(len(problem) < 400 for problem in reading.problems)
    before = path.read_bytes()
    kept = repair(tmp_path)
    assert kept is not None
    assert kept.read_bytes() == before
    assert read_records(tmp_path) == Reading(reading.records, (), (), reading.every)
    assert path.read_bytes() == b"".join([*lines, record(4).to_json().encode() + b"\n"])
    assert repair(tmp_path) is None


@given(st.binary(max_size=40), st.integers(0, 3))
def test_any_bytes_between_records_lose_none_of_them(garbage: bytes, at: int) -> None:
    lines = [record(k).to_json().encode() + b"\n" for k in range(4)]
    lines.insert(at, garbage.replace(b"\n", b" ") + b"\n")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, RECORDS_NAME)
        path.write_bytes(b"".join(lines))
        found = scan(path)
    assert [r.repetition for r in found.every] == [0, 1, 2, 3]


def test_a_newline_that_became_nul_loses_no_record(tmp_path: Path) -> None:
    path = tmp_path / RECORDS_NAME
    path.write_bytes(b"\0\0\0".join(record(k).to_json().encode() for k in range(3)) + b"\n")
    reading = read_records(path)
    assert [r.repetition for r in reading.records] == [0, 1, 2]
    assert reading.problems == (f"{path}:1: the line is damaged and left out: it holds NUL bytes",)


def test_a_record_too_long_to_be_read_keeps_all_but_its_details(tmp_path: Path) -> None:
    path = tmp_path / RECORDS_NAME
    details = {"log": "logs/a.log", "poses": "x" * LARGEST_LINE}
    RecordFile(path).append(record(1, details=details, metrics={"placed": 0.5}))
    (found,) = read_records(path).records
    assert found.metrics == {"placed": 0.5}
    assert found.details["log"] == "logs/a.log"
    assert "more than a record may have" in found.details["left_out"]


@pytest.mark.parametrize("kind", ["fifo", "device", "link out"])
def test_only_an_ordinary_file_in_the_folder_is_read(tmp_path: Path, kind: str) -> None:
    run = tmp_path / "run"
    run.mkdir()
    path = run / RECORDS_NAME
    (tmp_path / "other").write_text(record(1).to_json() + "\n")
    if kind == "fifo":
        os.mkfifo(path)
    else:
        path.symlink_to({"device": "/dev/zero", "link out": tmp_path / "other"}[kind])
    with pytest.raises(RecordError, match=r"no ordinary file|leads out of its folder"):
        read_records(run)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"test": 3}, "'test' must be str, not int"),
        ({"test": "x" * 5000}, "'test' has 5000 characters, at most 2000 are read"),
        ({"jitter": -1}, "'jitter' must be at least 0"),
        ({"attempt": 0}, "'attempt' must be at least 1"),
        ({"repetition": -3}, "'repetition' must be at least 0"),
        ({"seed": 10**400}, "'seed' is larger than any number of ours"),
        ({"metrics": {"placed": 10**400}}, "'metrics.placed' is larger than any number"),
        ({"seconds": {"total": "long"}}, "'seconds.total' must be a number, not 'long'"),
        ({"stepping": {"wall": [1]}}, "'stepping.wall' must be a number"),
        ({"timeline": {"start": {}}}, "'timeline.start' must be a number"),
        ({"limits": {"timeout": "x"}}, "'limits.timeout' must be a number"),
        ({"resources": {"rss_mb": 3}}, "'resources.rss_mb' must be dict, not int"),
        ({"resources": {"samples": "x"}}, "'resources.samples' must be a number"),
        ({"resources": {"samples": -1}}, "'resources.samples' must be at least 0"),
        ({"resources": {"phases": {"load": {"rss_mb": {"mean": "x"}}}}}, "'resources.phases.load."),
        ({"versions": {"engine": 3}}, "'versions.engine' must be str, not int"),
        ({"details": {"log": ["a"]}}, "'details.log' must be str, not list"),
        ({"details": {"untested": {}}}, "'details.untested' must be str, not dict"),
        ({"deviations": [3]}, "'deviations' must be str, not int"),
        ({"error": {"type": "E", "message": 3}}, "'error.message' must be str, not int"),
        ({"schema": 0}, "schema 0 "),
        ({"schema": "x" * 999}, "schema 'xxxx"),
    ],
)
def test_foreign_records_of_wrong_types_are_refused(
    tmp_path: Path, change: dict[str, Any], message: str
) -> None:
    path = tmp_path / RECORDS_NAME
    wrong = json.dumps({**record().to_dict(), **change})
    path.write_text(record().to_json() + "\n" + wrong + "\n")
    with pytest.raises(RecordError) as caught:
        read_records(path)
    assert str(caught.value).startswith(f"{path}:2: {message}")
    assert len(str(caught.value)) < 400
    assert len(scan(path).records) == 1


def test_infinite_numbers_and_deep_nests_are_refused(tmp_path: Path) -> None:
    path = tmp_path / RECORDS_NAME
    good = record(details={"a": 1}).to_json()
    deep = "[" * 60 + "]" * 60
    for text, message in ((deep, "nested more than 32"), ("1e999", "must be a finite number")):
        path.write_text(good.replace('{"a": 1}', f'{{"a": {text}}}') + "\n")
        with pytest.raises(RecordError, match=rf":1: .*{message}"):
            read_records(path)


def test_a_text_that_no_file_takes_can_be_written_again(tmp_path: Path) -> None:
    path = tmp_path / RECORDS_NAME
    RecordFile(path).append(record(details={"note": "\ud800 x"}))
    path.write_text(path.read_text().replace("? x", "\\udfff x"))
    (found,) = read_records(path).records
    assert found.details["note"].encode("utf-8") == b"? x"


def test_a_nest_too_deep_is_told_without_its_depth(tmp_path: Path) -> None:
    """What Python says of its stack is of no use to a reader of records."""
    path = tmp_path / RECORDS_NAME
    path.write_bytes(b"[" * 100_000 + b"\n" + record().to_json().encode() + b"\n")
    (problem,) = read_records(path).problems
    assert problem == f"{path}:1: the line is damaged and left out: not JSON (RecursionError)"


def test_a_file_that_cannot_be_read_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / RECORDS_NAME
    path.write_text(record().to_json() + "\n")

    def refused(*args: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refused)
    with pytest.raises(RecordError) as caught:
        read_records(path)
    assert str(caught.value) == (
        f"cannot read records from {path} (Permission denied); give a run folder or its "
        "records.jsonl"
    )
