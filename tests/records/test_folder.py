"""The run folder: what it holds, and what is wrong with what it holds."""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pytest_simbench.records.claims import Claim
from pytest_simbench.records.description import TaskDescription, Threshold
from pytest_simbench.records.folder import RECORDS, TASKS, THRESHOLDS, RunFolder
from pytest_simbench.records.lines import LARGEST_LINE
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.paths import FolderError
from pytest_simbench.records.record import RecordError

from .build import failed, record


def test_what_holds_a_run(tmp_path: Path) -> None:
    assert not RunFolder(tmp_path / "nowhere").holds_run
    (told,) = RunFolder(tmp_path / "nowhere").scan().refused
    assert told.endswith(" (No such file or directory); give a run folder or its records.jsonl")
    (tmp_path / "records.jsonl").touch()
    (tmp_path / "other.txt").write_text("x")
    assert not RunFolder(tmp_path).holds_run
    (tmp_path / "repeatability.jsonl").write_text("x")
    assert RunFolder(tmp_path).holds_run


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seed": "7"}, "'seed': expected 'int', got 'str'"),
        ({"repetition": True}, "'repetition': expected 'int', got 'bool'"),
        ({"metrics": None}, "there is no 'metrics'"),
        (
            {"metrics": {"placed": "many"}},
            "'metrics[...]': expected 'bool | float | None'",
        ),
        ({"status": "fine"}, "'status': invalid enum value 'fine'"),
        ({"error": {"message": "x"}}, "'error': there is no 'type'"),
        ({"schema": 99}, "schema 99 was written by a newer pytest-simbench"),
        ({"test": 3}, "'test': expected 'str', got 'int'"),
        ({"test": "x" * 5000}, "'test': expected 'str' of length <= 2000"),
        ({"jitter": -1}, "'jitter': expected 'float' >= 0.0"),
        ({"attempt": 0}, "'attempt': expected 'int' >= 1"),
        ({"repetition": -3}, "'repetition': expected 'int' >= 0"),
        ({"seed": 10**400}, "'seed' is larger than any number of ours"),
        ({"metrics": {"placed": 10**400}}, "'metrics.placed' is larger than any number"),
        ({"metrics": {"placed": 1e101}}, "'metrics[...]': expected 'float' <= 1e+100"),
        ({"metrics": {"placed": -(10**101)}}, "'metrics[...]': expected 'float' >= -1e+100"),
        ({"seconds": {"total": 1e308}}, "'seconds[...]': expected 'float' <= 1e+100"),
        ({"seconds": {"total": "long"}}, "'seconds[...]': expected 'float', got 'str'"),
        ({"stepping": {"wall": [1]}}, "'stepping[...]': expected 'float', got 'list'"),
        ({"timeline": {"start": {}}}, "'timeline[...]': expected 'float', got 'dict'"),
        ({"limits": {"timeout": "x"}}, "'limits[...]': expected 'float | None', got 'str'"),
        ({"resources": {"rss_mb": 3}}, "'resources.rss_mb': expected 'dict | None', got 'int'"),
        ({"resources": {"samples": "x"}}, "'resources.samples': expected 'int | None', got 'str'"),
        ({"resources": {"samples": -1}}, "'resources.samples': expected 'int' >= 0"),
        (
            {"resources": {"phases": {"load": {"rss_mb": {"mean": "x"}}}}},
            "'resources.phases[...].rss_mb[...]': expected 'float | None', got 'str'",
        ),
        ({"versions": {"engine": 3}}, "'versions[...]': expected 'str', got 'int'"),
        ({"notes": {"log": ["a"]}}, "'notes.log': expected 'str', got 'list'"),
        ({"notes": {"untested": {}}}, "'notes.untested': expected 'str', got 'dict'"),
        ({"deviations": [3]}, "'deviations[0]': expected 'str', got 'int'"),
        ({"error": {"type": "E", "message": 3}}, "'error.message': expected 'str', got 'int'"),
        ({"schema": 0}, "schema 0 "),
        ({"schema": "x" * 999}, "schema 'xxxx"),
    ],
)
def test_a_wrong_value_is_named_with_file_and_line(
    change: dict[str, Any], message: str, tmp_path: Path
) -> None:
    path = tmp_path / RECORDS
    wrong = json.dumps({**record().to_dict(), **change})
    path.write_text(record().to_json() + "\n" + wrong + "\n")
    with pytest.raises(RecordError) as caught:
        RunFolder.of(path).read()
    assert str(caught.value).startswith(f"{path}:2: {message}")
    assert len(str(caught.value)) < 400
    assert len(RunFolder.of(path).scan().records) == 1


def test_appended_records_are_read_back(tmp_path: Path) -> None:
    path = tmp_path / "run" / RECORDS
    folder = RunFolder(path.parent)
    written = [record(0), failed(1), record(2)]
    for item in written:
        folder.append(item)
    assert path.read_bytes().count(b"\n") == 3  # on the disk before closing
    assert not folder.close()
    assert RunFolder(path.parent).read().records == tuple(written)


def test_a_record_too_long_to_be_read_keeps_all_but_its_details(tmp_path: Path) -> None:
    path = tmp_path / RECORDS
    details = {"poses": "x" * LARGEST_LINE}
    noted = record(1, details=details, metrics={"placed": 0.5}).noting(log="logs/a.log")
    RunFolder(path.parent).append(noted)
    (found,) = RunFolder.of(path).read().records
    assert json.loads(path.read_text())["details"] == {}
    assert found.metrics == {"placed": 0.5}
    assert found.notes.log == "logs/a.log"
    size = len(noted.to_json())
    assert found.notes.left_out == f"{size} bytes, more than a record may have"


def test_infinite_numbers_and_deep_nests_are_refused(tmp_path: Path) -> None:
    path = tmp_path / RECORDS
    good = record(details={"a": 1}).to_json()
    deep = "[" * 60 + "]" * 60
    for text, message in ((deep, "nested more than 32"), ("1e999", "must be a finite number")):
        path.write_text(good.replace('{"a": 1}', f'{{"a": {text}}}') + "\n")
        with pytest.raises(RecordError, match=rf":1: .*{message}"):
            RunFolder.of(path).read()


def test_a_text_that_no_file_takes_can_be_written_again(tmp_path: Path) -> None:
    path = tmp_path / RECORDS
    RunFolder(path.parent).append(record(details={"note": "\ud800 x"}))
    path.write_text(path.read_text().replace("? x", "\\udfff x"))
    (found,) = RunFolder.of(path).read().records
    assert found.details["note"].encode("utf-8") == b"? x"


CAUGHT = Metric("caught", "caught", kind="share", of=7)
SPILL = Metric("spill", "spilt", "ml", better="lower")
POURING = TaskDescription("pouring", (CAUGHT, SPILL), {"spill": 0.1})


def folder_with(path: Path, *tasks: TaskDescription) -> RunFolder:
    folder = RunFolder(path)
    folder.append(record(1, task="pouring", metrics={"caught": 0.5}))
    for task in tasks:
        folder.describe(task)
    return RunFolder(path)


def test_what_numbers_mean_is_read_back_and_written_once(tmp_path: Path) -> None:
    folder = folder_with(tmp_path, POURING, POURING)
    folder.describe(POURING)
    assert len((tmp_path / TASKS).read_text().splitlines()) == 1
    found = folder.read()
    assert found.tasks == {"pouring": POURING}
    assert found.metrics == {"pouring": (CAUGHT, SPILL)}
    assert found.references == {"pouring": {"spill": 0.1}}
    assert RunFolder.of(tmp_path / RECORDS).read().tasks == found.tasks


def test_tests_of_one_task_tell_its_numbers_together(tmp_path: Path) -> None:
    said = TaskDescription("pouring", (replace(CAUGHT, doc="new"), Metric("left", "left")))
    both = replace(POURING, metrics=(said.metrics[0], SPILL, said.metrics[1]))
    assert folder_with(tmp_path, POURING, said).read().tasks == {"pouring": both}
    other = TaskDescription("pouring", (replace(SPILL, unit="l"),))
    with pytest.raises(RecordError, match='spill of pouring was "ml", is "l": another task of'):
        RunFolder(tmp_path).describe(other)
    with (tmp_path / TASKS).open("a") as file:  # two processes at once, or an older version
        file.write(json.dumps(other.to_dict()) + "\n")
    found = RunFolder(tmp_path).read()
    assert found.metrics["pouring"][1].unit == "l"
    assert found.problems == (f"{tmp_path / TASKS}: unit of the metric spill of pouring was "
                              '"ml", is "l"; the last one holds',)  # fmt: skip


def test_thresholds_are_read_back_each_once(tmp_path: Path) -> None:
    folder = folder_with(tmp_path)
    asked = [Threshold("t", "caught", 0.9), Threshold("u", "spill", 3.0)]
    for threshold in [*asked, *asked]:
        folder.ask(threshold)
    assert RunFolder(tmp_path).read().thresholds == tuple(asked)
    assert len((tmp_path / THRESHOLDS).read_text().splitlines()) == 2


def test_what_came_of_claims_is_read_back_in_its_order(tmp_path: Path) -> None:
    """All of them, also what was judged anew; another reader has them from the disk."""
    folder = folder_with(tmp_path)
    assert not folder.used
    first = Claim("t[a]", "t", "a", "headless", "tuned", "FAIL", metric="caught", threshold=0.9)
    again = replace(first, verdict="PASS", relation="at least", mean=0.95, n=20)
    for claim in (first, again):
        folder.claim(claim)
    assert folder.scan().claims[-2:] == RunFolder(tmp_path).read().claims == (first, again)
    folder.ask(Threshold("t", "caught", 0.9))
    assert folder.used


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (b'{"schema": 1, "task": "po', "the line is damaged and left out: not JSON"),
        (b"\0\0\0", "the line is damaged and left out: it holds NUL bytes"),
        (b'{"task": 3, "metrics": []}', "'task': expected 'str', got 'int'"),
        (b'{"task": "pouring", "metrics": 1}', "'metrics': expected 'list', got 'int'"),
        (b'{"schema": 9}', "schema 9 was written by a newer pytest-simbench"),
    ],
)
def test_a_bad_description_is_told_and_takes_nothing_with_it(
    tmp_path: Path, line: bytes, message: str
) -> None:
    folder_with(tmp_path, POURING)
    with (tmp_path / TASKS).open("ab") as file:
        file.write(line)
    other = TaskDescription("baking", ())
    folder_with(tmp_path, other)
    found = RunFolder(tmp_path).read()
    assert found.tasks == {"pouring": POURING, "baking": other}
    (problem,) = found.problems
    assert problem.startswith(f"{tmp_path / TASKS}:2: {message}")
    assert found.records


@pytest.mark.parametrize("name", [RECORDS, TASKS])
@pytest.mark.parametrize("kind", ["fifo", "device", "folder", "link out"])
def test_only_an_ordinary_file_in_the_folder_is_read(tmp_path: Path, name: str, kind: str) -> None:
    run = tmp_path / "run"
    folder_with(run, POURING)
    path = run / name
    path.rename(tmp_path / "other")
    if kind == "fifo":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    else:
        path.symlink_to({"device": "/dev/zero", "link out": tmp_path / "other"}[kind])
    found = RunFolder(run).scan()
    assert (found.records == ()) is (name == RECORDS)
    assert (found.tasks == {}) is (name == TASKS)
    (problem,) = (*found.problems, *found.refused)
    why = {"fifo": "it is no ordinary file", "folder": "Is a directory"}
    assert f" ({why.get(kind, 'leads out of its folder or is a link')})" in problem
    assert RunFolder(run).repair() == ()


def test_damaged_descriptions_hide_no_records_and_are_repaired(tmp_path: Path) -> None:
    folder_with(tmp_path, POURING)
    for name in (TASKS, "repeatability.jsonl"):
        with (tmp_path / name).open("ab") as file:
            file.write(b'{"schema": 1')
    assert len(RunFolder(tmp_path).read().problems) == 1
    kept = RunFolder(tmp_path).repair()
    assert [path.name for path in kept] == [
        "tasks.jsonl.damaged-1",
        "repeatability.jsonl.damaged-1",
    ]
    assert RunFolder(tmp_path).read() == replace(RunFolder(tmp_path).read(), problems=())
    (tmp_path / RECORDS).write_text("")
    (tmp_path / TASKS).write_text("{")
    found = RunFolder(tmp_path).read()  # an empty run, whose records are not damaged
    assert (found.records, len(found.problems)) == ((), 1)


def test_a_lost_folder_is_read_from_memory(tmp_path: Path) -> None:
    """What the disk does not take stays in the process, and goes where a run can be read again."""
    (tmp_path / "run").touch()  # a file where the folder should be
    folder = RunFolder(tmp_path / "run")
    folder.append(record(1, task="pouring"))
    folder.describe(POURING)
    found = folder.scan()
    assert [r.repetition for r in found.records] == [1]
    assert found.tasks == {"pouring": POURING}
    told = folder.close()
    why = f"(File exists); they are in {Path(told[0].rpartition(' ')[2]).parent}"
    assert told == tuple(
        f"1 {noun} could not be written to {tmp_path / 'run' / name} {why}/{name}"
        for noun, name in (("record", RECORDS), ("task description", TASKS))
    )
    (spare,) = {Path(text.rpartition(" ")[2]).parent for text in told}
    again = RunFolder(spare).read()
    assert (again.records, again.tasks) == (found.records, found.tasks)
    shutil.rmtree(spare)


def test_records_of_another_process_are_not_counted_twice(tmp_path: Path) -> None:
    folder = folder_with(tmp_path)
    folder.take_over([record(1, task="pouring", metrics={"caught": 0.5}), record(2)])
    assert [r.repetition for r in folder.read().records] == [1, 2]


def test_a_claimed_folder_is_given_up(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path / "run")
    folder.lock()
    folder.lock()  # once is enough
    assert folder.locked
    with pytest.raises(FolderError, match="another run is under way"):
        RunFolder(tmp_path / "run").lock()
    assert folder.close() == ()
    assert not folder.locked
    assert not (tmp_path / "run").exists()
    folder.describe(POURING)
    RunFolder(tmp_path / "run").lock()  # what a run left that recorded nothing is gone
    assert not (tmp_path / "run" / TASKS).exists()


def test_a_nest_too_deep_is_told_without_its_depth(tmp_path: Path) -> None:
    """What Python says of its stack is of no use to a reader of records."""
    path = tmp_path / RECORDS
    path.write_bytes(b"[" * 100_000 + b"\n" + record().to_json().encode() + b"\n")
    (problem,) = RunFolder(tmp_path).read().problems
    assert problem == f"{path}:1: the line is damaged and left out: not JSON (RecursionError)"


def test_a_file_that_cannot_be_read_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / RECORDS
    path.write_text(record().to_json() + "\n")

    def refused(*args: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("pytest_simbench.records.lines.opened", refused)
    with pytest.raises(RecordError) as caught:
        RunFolder(tmp_path).read()
    assert str(caught.value) == (
        f"cannot read records from {path} (Permission denied); give a run folder or its "
        "records.jsonl"
    )
