"""Every form of a baseline gives the same records; a malformed one says what is wrong."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pytest_simbench.records.baseline import (
    KEY,
    BaselineError,
    from_benchmarks,
    from_extra_info,
    read_baseline,
    to_extra_info,
)
from pytest_simbench.records.description import TaskDescription
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.record import Record

from .build import failed, record

RUN = [
    record(0, metrics={"placed": 1.0, "hit": None}, details={"log": "logs/x.log"}),
    record(1, metrics={"placed": 0.5, "hit": 1.0}, versions={"engine": "2.0"}),
    failed(2),
]


def without_details(item: Record) -> dict[str, object]:
    data = item.to_dict()
    del data["details"]
    if data["error"]:
        data["error"]["log_tail"] = ""
    return data


def test_saving_with_the_benchmarks_loses_nothing_that_is_compared() -> None:
    saved = json.loads(json.dumps(to_extra_info(RUN)))
    found = from_extra_info(saved, "here")
    assert [without_details(r) for r in found] == [without_details(r) for r in RUN]


def test_what_all_share_is_saved_once() -> None:
    saved = to_extra_info(RUN)
    assert saved["shared"]["settings"] == {"timestep": 0.002}
    assert all("settings" not in row for row in saved["repetitions"])
    assert [row["versions"] for row in saved["repetitions"]] == [r.versions for r in RUN]


@pytest.mark.parametrize("form", ["folder", "records", "benchmarks"])
def test_every_form_gives_the_same_records(tmp_path: Path, form: str) -> None:
    path = tmp_path
    if form == "benchmarks":
        path = tmp_path / "saved.json"
        extra = [{}, {"mine": 1}, {KEY: to_extra_info(RUN)}]
        path.write_text(json.dumps({"benchmarks": [{"extra_info": item} for item in extra]}))
    else:
        folder = RunFolder(tmp_path)
        for item in RUN:
            folder.append(item)
        path = tmp_path / "records.jsonl" if form == "records" else tmp_path
    found = read_baseline(path)
    assert found.name == str(path)
    assert [without_details(r) for r in found.records] == [without_details(r) for r in RUN]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "holds no repetition"),
        ("[1, 2]", "cannot be read: .*:1: a line is a JSON object, not list"),
        ('{"test": "t"}', "cannot be read: .*:1: there is no 'task'"),
        ('{"benchmarks": {}}', "malformed: 'benchmarks' is not a list"),
        ('{"benchmarks": [3, {"extra_info": 4}]}', "holds no repetition of a simulator"),
        ('{"benchmarks": [{"extra_info": {"simbench": 1}}]}', "does not hold repetitions"),
        ('{"benchmarks": [{"extra_info": {"simbench": {"repetitions": []}}}]}', "does not hold"),
        ('{"benchmarks": [{"extra_info": {"simbench": {"shared": {}}}}]}', "does not hold repet"),
        (
            '{"benchmarks": [{"fullname": "t", "extra_info": '
            '{"simbench": {"shared": {}, "repetitions": [1]}}}]}',
            "t: repetition 1 is not an object",
        ),
        (
            '{"benchmarks": [{"extra_info": {"simbench": {"shared": {}, "repetitions": [{}]}}}]}',
            "a benchmark without a name: repetition 1: there is no 'test'",
        ),
        (
            '{"benchmarks": [{"extra_info": '
            '{"simbench": {"schema": 99, "shared": {}, "repetitions": [{}]}}}]}',
            "written by a newer pytest-simbench",
        ),
    ],
)
def test_a_malformed_baseline_says_what_is_wrong(
    tmp_path: Path, content: str, message: str
) -> None:
    path = tmp_path / "saved"
    path.write_text(content)
    with pytest.raises(BaselineError, match=message):
        read_baseline(path)


def test_nothing_there(tmp_path: Path) -> None:
    with pytest.raises(BaselineError, match="there is no baseline .*; give a run folder"):
        read_baseline(tmp_path / "none")
    with pytest.raises(BaselineError, match="the folder .* holds no run; give [^;]*$"):
        read_baseline(tmp_path)


def test_an_empty_result_is_saved_as_such() -> None:
    assert from_extra_info(to_extra_info([]), "x") == []


SAID = TaskDescription(
    "stacking", (Metric("placed", "placed", kind="share", of=15),), {"placed": 1.0}
)


def test_a_saved_benchmark_says_what_its_numbers_mean() -> None:
    extra = json.loads(json.dumps(to_extra_info(RUN, [SAID])))
    found = from_benchmarks({"benchmarks": [{"extra_info": {KEY: extra}}]}, "x")
    assert found.tasks == {"stacking": SAID}
    assert found.problems == ()
    del extra["tasks"]  # of before
    found = from_benchmarks({"benchmarks": [{"extra_info": {KEY: extra}}]}, "x")
    assert (found.tasks, found.problems, len(found.records)) == ({}, (), len(RUN))


@pytest.mark.parametrize("said", [3, [3], {"task": "t"}, [{"task": "t", "metrics": [1]}]])
def test_what_is_no_description_is_told_and_the_records_are_read(said: object) -> None:
    extra = {**to_extra_info(RUN), "tasks": said}
    saved = {"benchmarks": [{"fullname": "t", "extra_info": {KEY: extra}}]}
    found = from_benchmarks(saved, "x")
    assert len(found.records) == len(RUN)
    assert found.tasks == {}
    (problem,) = found.problems
    assert problem.startswith("x, t: 'simbench': ")
