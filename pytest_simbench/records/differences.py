"""In what two runs differ besides their results: settings, versions, machines, as sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pytest_simbench.records.configuration import Use, field_of, partial, text, values
from pytest_simbench.records.record import Record

Runs = Mapping[str, tuple[Sequence[Record], Sequence[Record]]]


def differences(runs: Runs, use: Use = "compare", fields: Sequence[str] | None = None) -> list[str]:
    """One sentence for each value that differs, with the tests it differs in.

    What a side cannot know (a repetition that failed at its start has no versions) is no
    difference.

    Args:
        runs: for each test the records before and now.
        use: what for; says which fields must be equal.
        fields: look at these alone.
    """
    found: dict[str, list[str]] = {}
    for test, (before, now) in runs.items():
        old, new = _values(before, use), _values(now, use)
        for key in [*old, *(key for key in new if key not in old)]:
            if fields is not None and field_of(key) not in fields:
                continue
            if (key not in old and _unknown(before, key)) or (
                key not in new and _unknown(now, key)
            ):
                continue
            first, second = old.get(key, ["absent"]), new.get(key, ["absent"])
            if first != second:
                sentence = f"{key} was {' or '.join(first)}, is {' or '.join(second)}"
                found.setdefault(sentence, []).append(test)
    return [
        f"{sentence} ({'every test' if len(tests) == len(runs) > 1 else ', '.join(tests)})"
        for sentence, tests in found.items()
    ]


def _unknown(records: Sequence[Record], key: str) -> bool:
    return all(field_of(key) in partial(record) for record in records)


def _values(records: Sequence[Record], use: Use) -> dict[str, list[str]]:
    """The different values of each key in a set of records, as JSON, sorted."""
    found: dict[str, set[str]] = {}
    for record in records:
        for key, value in values(record, use).items():
            found.setdefault(key, set()).add(text(value))
    return {key: sorted(known) for key, known in found.items()}
