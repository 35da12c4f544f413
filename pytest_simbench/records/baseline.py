"""A run to compare with: a run folder, a record file, or a file of pytest-benchmark.

pytest-benchmark saves what a test gives it as `extra_info`: there the records lie, and what their
numbers mean. What all repetitions share (settings, versions, machine) is written once. Left out is
what no comparison reads: a task's details and the tails of logs.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from pytest_simbench.records.checked import CheckError
from pytest_simbench.records.description import TaskDescription, by_task
from pytest_simbench.records.folder import RECORDS, RunContents, RunFolder
from pytest_simbench.records.record import SCHEMA, Record, RecordError
from pytest_simbench.records.series import settled

KEY = "simbench"
"""Where a run lies in a benchmark's `extra_info`."""

FORMS = f"a run folder, its {RECORDS}, or a file written with --benchmark-json"
"""What a baseline may be, for messages."""


class BaselineError(ValueError):
    """A baseline that cannot be used; the message says why and what would be one."""


def read_baseline(path: Path) -> RunContents:
    """The run at `path`.

    Raises:
        BaselineError: there is none, it is malformed, or it holds no repetition.
    """
    if not path.exists():
        raise BaselineError(f"there is no baseline {path}; give {FORMS}")
    if path.is_dir() and not RunFolder(path).holds_run:
        raise BaselineError(f"the folder {path} holds no run; give {FORMS}")
    saved = _benchmark_file(path)
    if saved is not None:
        return from_benchmarks(saved, str(path))
    try:
        reading = RunFolder.of(path).read()
    except RecordError as error:
        raise BaselineError(f"the baseline cannot be read: {error}; give {FORMS}") from None
    if not reading.records:
        raise BaselineError(f"the baseline {path} holds no repetition; give {FORMS}")
    return replace(reading, name=str(path))


def _benchmark_file(path: Path) -> dict[str, Any] | None:
    """The content of a file of pytest-benchmark; None when it is none."""
    if not path.is_file():
        return None
    try:
        data = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return None  # a record file, which has a JSON object on each line, or garbage
    return data if isinstance(data, dict) and "benchmarks" in data else None


def from_benchmarks(saved: Mapping[str, Any], name: str) -> RunContents:
    """The run in the content of a pytest-benchmark file; benchmarks of other tests are left out.

    Raises:
        BaselineError: it is malformed, or holds no result of pytest-simbench.
    """
    benchmarks = saved.get("benchmarks")
    if not isinstance(benchmarks, list):
        raise BaselineError(f"the baseline {name} is malformed: 'benchmarks' is not a list")
    records: list[Record] = []
    tasks: list[TaskDescription] = []
    problems: list[str] = []
    for benchmark in benchmarks:
        extra = benchmark.get("extra_info") if isinstance(benchmark, Mapping) else None
        if not isinstance(extra, Mapping) or KEY not in extra:
            continue
        where = f"{name}, {benchmark.get('fullname', 'a benchmark without a name')}"
        try:
            records += from_extra_info(extra[KEY], where)
            tasks += _tasks(extra[KEY], where, problems)
        except RecordError as error:
            raise BaselineError(f"the baseline cannot be read: {error}; give {FORMS}") from None
    if not records:
        raise BaselineError(
            f"the baseline {name} holds no repetition of a simulator that this version can "
            f"compare; give {FORMS}"
        )
    return RunContents(name, tuple(settled(records)), by_task(tasks), problems=tuple(problems))


def _tasks(data: Mapping[str, Any], where: str, problems: list[str]) -> list[TaskDescription]:
    """What the numbers of a benchmark mean; older files do not tell."""
    found = []
    listed = data.get("tasks") or []
    for item in listed if isinstance(listed, list) else [listed]:
        try:
            found.append(TaskDescription.from_dict(item, f"{where}: {KEY!r}"))
        except CheckError as error:
            problems.append(str(error))
    return found


def to_extra_info(
    records: Iterable[Record], tasks: Iterable[TaskDescription] = ()
) -> dict[str, Any]:
    """`{"schema", "tasks": [...], "shared": {...}, "repetitions": [{...}, ...]}`, plain data."""
    rows = [_slim(record) for record in records]
    shared = {
        key: value
        for key, value in (rows[0].items() if rows else ())
        if all(key in row and row[key] == value for row in rows)
    }
    repetitions = [{k: v for k, v in row.items() if k not in shared} for row in rows]
    return {
        "schema": SCHEMA,
        "tasks": [task.to_dict() for task in tasks],
        "shared": shared,
        "repetitions": repetitions,
    }


def from_extra_info(data: Any, where: str) -> list[Record]:
    """The records in what `to_extra_info` made; `where` names it in messages.

    Raises:
        RecordError: it is something else, or holds what is no record.
    """
    shared = data.get("shared") if isinstance(data, Mapping) else None
    repetitions = data.get("repetitions") if isinstance(data, Mapping) else None
    if not isinstance(shared, Mapping) or not isinstance(repetitions, list):
        raise RecordError(f"{where}: {KEY!r} does not hold repetitions of pytest-simbench")
    records = []
    for number, row in enumerate(repetitions, start=1):
        if not isinstance(row, Mapping):
            raise RecordError(f"{where}: repetition {number} is not an object")
        whole = {"schema": data.get("schema", SCHEMA), **shared, **row}
        records.append(Record.from_dict(whole, f"{where}: repetition {number}"))
    return records


def _slim(record: Record) -> dict[str, Any]:
    data = record.to_dict()
    del data["schema"], data["details"]
    data["notes"].pop("log", None)
    if data["error"]:
        data["error"] = {**data["error"], "log_tail": ""}
    return data
