"""A result as pytest-benchmark saves it (`extra_info`), and the records in such a file again.

What all repetitions share (settings, versions, machine) is written once. Left out is what no
comparison reads: a task's details and the tails of logs.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from pytest_simbench.records.record import SCHEMA, Record, RecordError

KEY = "simbench"
"""Where the records lie in a benchmark's `extra_info`."""


def to_extra_info(records: Iterable[Record]) -> dict[str, Any]:
    """`{"schema", "shared": {...}, "repetitions": [{...}, ...]}`, plain data."""
    rows = [_slim(record) for record in records]
    shared = {
        key: value
        for key, value in (rows[0].items() if rows else ())
        if all(key in row and row[key] == value for row in rows)
    }
    repetitions = [{k: v for k, v in row.items() if k not in shared} for row in rows]
    return {"schema": SCHEMA, "shared": shared, "repetitions": repetitions}


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
    if data["error"]:
        data["error"] = {**data["error"], "log_tail": ""}
    return data
