"""Records and their file: round trip, malformed lines, full disks, several writers."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.measure.records import (
    RECORDS_NAME,
    Failure,
    Record,
    RecordError,
    RecordFile,
    read_records,
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
from pytest_simbench.measure.records import RecordFile
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
from pytest_simbench.measure.records import RecordFile
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
