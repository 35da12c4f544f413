"""In what two runs differ besides their results: settings, versions, machines."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pytest_simbench.measure.record import Record

COMPARED = (
    "profile",
    "protocol",
    "jitter",
    "contended",
    "reused_worker",
    "deviations",
    "settings",
    "versions",
    "host",
)
"""What of a record says how it was made; seeds are compared by pairing."""

Runs = Mapping[str, tuple[Sequence[Record], Sequence[Record]]]


def differences(runs: Runs, compared: Sequence[str] = COMPARED) -> list[str]:
    """One sentence for each value that differs, with the tests it differs in.

    Args:
        runs: for each test the records before and now.
        compared: fields of a record.
    """
    found: dict[str, list[str]] = {}
    for test, (before, now) in runs.items():
        old, new = _values(before, compared), _values(now, compared)
        for key in [*old, *(key for key in new if key not in old)]:
            first, second = old.get(key, ["absent"]), new.get(key, ["absent"])
            if first != second:
                text = f"{key} was {' or '.join(first)}, is {' or '.join(second)}"
                found.setdefault(text, []).append(test)
    return [
        f"{text} ({'every test' if len(tests) == len(runs) > 1 else ', '.join(tests)})"
        for text, tests in found.items()
    ]


def _values(records: Sequence[Record], compared: Sequence[str]) -> dict[str, list[str]]:
    """The different values of each key in a set of records, as JSON, sorted."""
    found: dict[str, set[str]] = {}
    for record in records:
        data = record.to_dict()
        for name in compared:
            for key, value in _flat(name, data[name]):
                found.setdefault(key, set()).add(json.dumps(value))
    return {key: sorted(values) for key, values in found.items()}


def _flat(key: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for name, item in value.items():
            yield from _flat(f"{key}.{name}", item)
    else:
        yield key, value
