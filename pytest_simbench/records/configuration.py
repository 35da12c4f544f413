"""What must be equal: the one table of what records share when they are pooled, ranked, resumed,
merged or compared, each line with its reason; and in what two runs differ, as sentences.

A score is the score of a configuration. Two repetitions belong to one configuration when nothing
differs of what this table says of *pool*. Every field of a record has its line, so that a new field
is a decision (`tests/records/test_configuration.py`).
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, NamedTuple

from pytest_simbench.records.description import TaskDescription
from pytest_simbench.records.record import Record, plain

Use = Literal["twin", "pool", "rank", "resume", "merge", "compare"]
"""`twin`: of two records of one configuration of which the later one counts. `pool`: in one row of
a table. `rank`: in two rows of which one may beat the other. `resume`: in a run that is gone on
with. `merge`: in runs that are merged. `compare`: named before a comparison with a baseline."""


@dataclass(frozen=True)
class ConfigurationField:
    """One field of a record.

    Attributes:
        name: of the field.
        equal_to: the uses in which it must be the same (in `compare`: is named when it is not).
        reason: why there, and why not elsewhere.
    """

    name: str
    equal_to: frozenset[Use]
    reason: str


def _part(name: str, uses: str, reason: str) -> ConfigurationField:
    return ConfigurationField(name, frozenset(uses.split()), reason)  # type: ignore[arg-type]


EVERYWHERE = "pool resume merge compare"

PARTS: tuple[ConfigurationField, ...] = (
    # What is repeated: records are found by these, so they never differ within a group.
    _part("test", "twin", "tells groups apart; merged runs may have it under another path"),
    _part("function", "", "follows from the test"),
    _part("variant", "", "follows from the test"),
    _part("task", "twin", "tells groups apart"),
    _part("version", "", "follows from the simulator's name"),
    _part("simulator", "twin", "tells groups apart; simulators are what is ranked"),
    _part("mode", "twin rank", "tells groups apart; modes are compared by a test of their own"),
    # The configuration.
    _part("profile", f"{EVERYWHERE} rank", "names the settings"),
    _part(
        "settings",
        f"{EVERYWHERE} rank",
        "another time step or another tower is another experiment; simulators that are ranked "
        "share the task's parameters alone",
    ),
    _part("protocol", f"{EVERYWHERE} rank", "real time and smoke versions measure something else"),
    _part("jitter", f"{EVERYWHERE} rank", "a larger disturbance is a harder task"),
    _part(
        "scene",
        f"{EVERYWHERE} rank",
        "a task whose code changed builds another world by the same name",
    ),
    _part("task_code", f"{EVERYWHERE} rank", "one that counts or acts otherwise is another one"),
    _part("robot", f"{EVERYWHERE} rank", "another arm or hand is another experiment"),
    _part("limits", EVERYWHERE, "a time-out decides which repetitions fail"),
    _part("versions", EVERYWHERE, "another engine, adapter or Python is another simulator"),
    # What the engine told of it.
    _part(
        "deviations",
        "merge compare",
        "machines that build other worlds are not joined; it is known only after loading, so a "
        "row lists all of them and a resumed run cannot ask",
    ),
    # Circumstances: times may depend on them, scores do not.
    _part("host", "compare", "several machines may share a run; a comparison of times says so"),
    _part("contended", "compare", "a note under the table; a comparison of times says so"),
    _part("reused_worker", "compare", "the first of a worker's repetitions is never a reused one"),
    # Which repetition it is.
    _part("repetition", "twin", "numbers the seeds of a run"),
    _part("seed", "twin", "pairs repetitions; the first seed must be the same in a run resumed"),
    _part("attempt", "", "the last of several attempts counts"),
    # Results.
    *(
        _part(name, "", "a result")
        for name in (
            "status", "error", "metrics", "details", "notes", "reasons", "seconds", "stepping",
            "timeline", "resources",
        )
    ),
    _part("extra", "", "of a newer plugin: not known what it means"),
)  # fmt: skip

MEANING: tuple[ConfigurationField, ...] = (
    _part("name", "", "tells metrics apart"),
    _part("unit", "resume merge compare", "metres and millimetres are no series"),
    _part("kind", "resume merge compare", "a share and a length are no series"),
    _part("better", "resume merge compare", "worse would be better in a part of the records"),
    _part("of", "", "follows from the task's parameters, which must be equal"),
    *(
        _part(name, "", "for the reader only; the last one holds")
        for name in ("title", "study", "doc", "resolution", "least")
    ),
)
"""The same for what a folder says of a metric; within one folder there is one meaning."""


@cache
def equal_to(use: Use) -> tuple[str, ...]:
    """Names of the fields that must be equal for a use."""
    return tuple(part.name for part in PARTS if use in part.equal_to)


LATE = frozenset({"versions", "deviations"})
"""Told by the engine: a repetition that failed may have ended before it knew all of them."""

NEW = frozenset({"scene", "limits", "task_code"})
"""Not in records of pytest-simbench before 0.1.0's release: what is not there is not known."""

TASK = "task."
"""Before a task's parameters among the settings: known before anything ran."""


def _values(record: Record, use: Use) -> dict[str, Any]:
    untold: tuple[Any, ...] = ("",) if record.ok else ("", [])
    return {
        key: value
        for name in equal_to(use)
        for key, value in _flat(name, getattr(record, name))
        if not (name in NEW | LATE and value in untold)
        and not (use == "rank" and name == "settings" and not key.startswith(f"settings.{TASK}"))
    }


def task_parameters(record: Record) -> str:
    """The parameters of a record's task, as JSON."""
    return text({k: plain(v) for k, v in record.settings.items() if k.startswith(TASK)})


def partial(record: Record) -> frozenset[str]:
    """The fields of which a record may not know everything: absent means unknown there."""
    if record.ok:
        return NEW
    told = any(not key.startswith(TASK) for key in record.settings)
    return NEW | LATE if told else NEW | LATE | {"settings"}


def field_of(key: str) -> str:
    """The field that a key of `values` belongs to."""
    return key.partition(".")[0]


class ToldConfiguration(NamedTuple):
    """What a record tells of its configuration.

    Attributes:
        plain: of everything that must be equal: `settings.timestep` to 0.002.
        values: the same as JSON.
        unknown: fields of which it may not tell everything.
        parts: the fields themselves, kept so that no other object gets their identity.
    """

    plain: dict[str, Any]
    values: dict[str, str]
    unknown: frozenset[str]
    parts: tuple[Any, ...]

    @classmethod
    def of(cls, record: Record, use: Use = "pool") -> ToldConfiguration:
        """Of records that were read together most share these fields, so it is found out once for
        all of them; and each record keeps it."""
        kept: dict[str, ToldConfiguration] = vars(record).setdefault("_told", {})
        if use not in kept:
            parts = tuple(getattr(record, name) for name in equal_to(use))
            same = (repr(p) if isinstance(p, str | int | float | None) else id(p) for p in parts)
            unknown = partial(record)
            key = (use, unknown, *same)
            if key not in _found:
                if len(_found) >= _MOST_FOUND:
                    _found.clear()
                found = _values(record, use)
                shown = {name: text(value) for name, value in found.items()}
                _found[key] = cls(found, shown, unknown, parts)
            kept[use] = _found[key]
        return kept[use]

    def agrees(self, other: ToldConfiguration) -> bool:
        """Whether nothing known contradicts that both are of one configuration."""
        a, b = self.values, other.values
        return a is b or all(
            a[key] == b[key]
            if key in a and key in b
            else field_of(key) in (other.unknown if key in a else self.unknown)
            for key in a.keys() | b.keys()
        )


_found: dict[tuple[Any, ...], ToldConfiguration] = {}
_MOST_FOUND = 1000


def agree(first: Record, second: Record, use: Use = "pool") -> bool:
    """Whether nothing known contradicts that both are of one configuration."""
    return ToldConfiguration.of(first, use).agrees(ToldConfiguration.of(second, use))


def text(value: Any) -> str:
    """A value as JSON, for comparing and for messages."""
    return json.dumps(value, sort_keys=True)


def bare(value: object) -> str:
    """The same, but of a text without quotes."""
    return value if isinstance(value, str) else text(value)


def _flat(key: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Maps as keys with dots; tuples and numpy values as a record's file holds them."""
    if isinstance(value, Mapping):
        for name, item in value.items():
            yield from _flat(f"{key}.{name}", item)
    else:
        yield key, plain(value)


Runs = Mapping[str, tuple[Sequence[Record], Sequence[Record]]]


def differences(runs: Runs, use: Use = "compare", fields: Sequence[str] | None = None) -> list[str]:
    """One sentence for each value that differs between the records of a test before and now, with
    the tests it differs in. The use says which fields must be equal; of `fields`, if they are
    given, these alone.

    What a side cannot know (a repetition that failed at its start has no versions) is no
    difference.
    """
    found: dict[str, list[str]] = {}
    for test, (before, now) in runs.items():
        old, new = _each_value(before, use), _each_value(now, use)
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


def other_meanings(
    before: Mapping[str, TaskDescription], now: Mapping[str, TaskDescription], use: Use = "compare"
) -> list[str]:
    """One sentence for each metric that both runs have and that means something else in one."""
    found = []
    for task in (name for name in now if name in before):
        old = {metric.name: metric for metric in before[task].metrics}
        for metric in (m for m in now[task].metrics if m.name in old):
            for name in (part.name for part in MEANING if use in part.equal_to):
                was, is_ = getattr(old[metric.name], name), getattr(metric, name)
                if was != is_:
                    found.append(
                        f"{name} of the metric {metric.name} of {task} was {text(was)}, is "
                        f"{text(is_)}"
                    )
    return found


def _unknown(records: Sequence[Record], key: str) -> bool:
    return all(field_of(key) in partial(record) for record in records)


def _each_value(records: Sequence[Record], use: Use) -> dict[str, list[str]]:
    """The different values of each key in a set of records, as JSON, sorted."""
    found: dict[str, set[str]] = {}
    for told in {
        id(told): told for told in (ToldConfiguration.of(record, use) for record in records)
    }.values():
        for key, value in told.values.items():
            found.setdefault(key, set()).add(value)
    return {key: sorted(known) for key, known in found.items()}
