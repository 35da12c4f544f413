"""Records sorted by what they are of: which count, which belong together, and what tells apart."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import NamedTuple, TypeVar

from pytest_simbench.ground.versions import VersionedName, release_numbers
from pytest_simbench.records.configuration import (
    ToldConfiguration,
    Use,
    agree,
    bare,
    equal_to,
    field_of,
    task_parameters,
    text,
)
from pytest_simbench.records.record import Record

T = TypeVar("T")
K = TypeVar("K")


def settled(records: Iterable[Record]) -> list[Record]:
    """Of each repetition of one configuration the record that counts, in their order.

    One that came to an end counts before one that was interrupted; of several that came to an end
    the one of the last attempt, and of one attempt the one that was written last.
    """
    found: list[Record] = []
    places: dict[tuple[object, ...], list[int]] = {}
    for record in records:
        key = tuple(getattr(record, name) for name in equal_to("twin"))
        twins = places.setdefault(key, [])
        for place in twins:
            if agree(found[place], record):
                found[place] = _better(found[place], record)
                break
        else:
            twins.append(len(found))
            found.append(record)
    return found


def _better(first: Record, later: Record) -> Record:
    """Which of two records of one repetition counts."""
    ended = first.status != "interrupted", later.status != "interrupted"
    if ended[0] != ended[1]:
        return first if ended[0] else later
    return first if first.attempt > later.attempt else later


def configurations(records: Iterable[Record]) -> list[list[Record]]:
    """The records by configuration, each group in their order.

    One that failed before its engine told everything goes where nothing contradicts.
    """
    records = list(records)
    groups: list[list[int]] = []
    # Those that know everything come first: the others are compared with them.
    facts = [ToldConfiguration.of(record) for record in records]
    for place in sorted(range(len(records)), key=lambda k: not records[k].ok):
        for group in groups:
            if facts[group[0]].agrees(facts[place]):
                group.append(place)
                break
        else:
            groups.append([place])
    return [[records[k] for k in sorted(group)] for group in sorted(groups, key=min)]


def grouped(items: Iterable[T], key: Callable[[T], K]) -> dict[K, list[T]]:
    """Items by what they have in common, groups and items in order of appearance."""
    found: dict[K, list[T]] = {}
    for item in items:
        found.setdefault(key(item), []).append(item)
    return found


class RowKey(NamedTuple):
    """What a row of a table is of, besides its configuration; rows are sorted by it.

    Attributes:
        function: id of the test without its parameters.
        parameters: robot, time step of a sweep, and the test's variant, as ids have them.
    """

    simulator: str
    mode: str
    profile: str
    function: str
    parameters: str

    @classmethod
    def of(cls, record: Record) -> RowKey:
        step = record.settings.get("timestep") if record.swept else None
        parts = [
            record.robot.get("name", ""),
            f"dt={step_text(step)}" if isinstance(step, int | float) else "",
            record.variant,
        ]
        parameters = "-".join(filter(None, parts))
        return cls(record.simulator, record.mode, record.profile, record.function, parameters)

    @property
    def order(self) -> tuple[object, ...]:
        """Headless before GUI, as in the study's table; releases by their numbers."""
        name = VersionedName.of(self.simulator)
        version = (name.base, name.kind, release_numbers(name.which), self.simulator)
        return (version, self.mode == "gui", *self[1:])


class Series(NamedTuple):
    """The repetitions of one row.

    Attributes:
        key: what they are of.
        records: one configuration, by repetition.
        label: what tells the row from others of its simulator, mode and profile; may be empty.
    """

    key: RowKey
    records: list[Record]
    label: str


def series(records: Iterable[Record]) -> list[Series]:
    """The records of one task as rows, sorted: a row is one test and one configuration."""
    by_subject = grouped(sorted(records, key=lambda r: r.repetition), RowKey.of)
    ordered = sorted(by_subject.items(), key=lambda item: item[0].order)
    rows = [(s, group) for s, found in ordered for group in configurations(found)]
    return [
        Series(key, group, _label(key, group, [r for r in rows if r[0][:3] == key[:3]]))
        for key, group in rows
    ]


def _label(
    key: RowKey, group: Sequence[Record], rows: Sequence[tuple[RowKey, Sequence[Record]]]
) -> str:
    """The test's function where the rows differ in it, then in what its rows differ."""
    parts = [key.function] if len({s.function for s, _ in rows}) > 1 else []
    same = [(s, found) for s, found in rows if s.function == key.function]
    if len(same) > 1:
        known = [told(found) for _, found in same]
        keys = _keys(known)
        if _kinds(keys, known) < len(same) and key.parameters:
            parts.append(f"[{key.parameters}]")
        mine = told(group)
        differences = [_difference(k, mine.get(k)) for k in keys]
        parts += differences[:MOST] + ["..."] * (len(differences) > MOST)
    return " ".join(parts)


def _keys(known: Sequence[Mapping[str, object]]) -> list[str]:
    """In what rows differ."""
    every = dict.fromkeys(name for other in known for name in other)
    keys = [k for k in every if len({text(other.get(k)) for other in known}) > 1]
    if ROBOT in keys:
        keys = [ROBOT, *(k for k in keys if k != ROBOT and not _follows(k, ROBOT, known))]
    named = [k for k in keys if k != SCENE]
    return named if _kinds(named, known) == _kinds(keys, known) else keys


def labels(runs: Sequence[Sequence[Sequence[Record]]]) -> list[list[str]]:
    """What tells the configurations of each run apart, in words that match between the runs, which
    may be of other versions; what one of a run cannot know, which never started, tells nothing."""
    every = [[told(group) for group in run] for run in runs]
    keys = dict.fromkeys(
        key
        for known in every
        for key in _keys(known)
        if field_of(key) != "versions" and all(key in one for one in known)
    )
    return [[" ".join(_difference(k, one.get(k)) for k in keys) for one in run] for run in every]


Configured = tuple[str, ...]
"""Simulator, mode, profile, and where there are several what tells its configuration apart."""


def configured(
    records: Iterable[Record], run: Callable[[Record], object]
) -> dict[Configured, list[Record]]:
    """Records by who did them, those of several configurations apart: what differs within one run
    tells them apart in all, and in what else runs differ counts for nothing."""
    found: dict[Configured, list[Record]] = {}
    for who, own in grouped(records, lambda r: r.who).items():
        runs = [configurations(of_one) for of_one in grouped(own, run).values()]
        for group, label in zip(chain(*runs), chain(*labels(runs)), strict=True):
            found.setdefault((*who, label) if label else who, []).extend(group)
    return found


MOST = 3
"""Differences that a row's name lists."""

ROBOT = "robot.name"
"""What tells robots apart; their scenes, sizes and files differ with it."""

SCENE = "scene"
"""A digest: it tells nobody anything where a parameter tells as much."""


def _kinds(keys: Sequence[str], known: Sequence[Mapping[str, object]]) -> int:
    """How many rows keys tell apart."""
    return len({tuple(text(other.get(k)) for k in keys) for other in known})


def _follows(key: str, chief: str, known: Sequence[Mapping[str, object]]) -> bool:
    """Whether one value is known as soon as the other is."""
    pairs = {(text(other.get(chief)), text(other.get(key))) for other in known}
    return len(pairs) == len({first for first, _ in pairs})


def _difference(key: str, value: object) -> str:
    if key == ROBOT:
        return f"robot={bare(value)}" if value else "default robot"
    return f"{key.removeprefix('settings.')}={bare(value)}"


def comparable(a: Series, b: Series, *, profiles: bool = False) -> bool:
    """Whether one row may be said to beat the other: the same was asked of both, or of two
    `profiles` of one simulator."""
    if a.label != b.label and a.key[3:] != b.key[3:]:
        return False
    first, second = (
        {key: text(value) for key, value in told(row.records, "rank").items()} for row in (a, b)
    )
    beside = {"profile"} if profiles else set()
    return all(second.get(key, first[key]) == first[key] for key in first.keys() - beside)


def told(records: Sequence[Record], use: Use = "pool") -> dict[str, object]:
    """What the records of one configuration say of it together."""
    found: dict[str, object] = {}
    ordered = (
        ToldConfiguration.of(record, use).plain
        for record in sorted(records, key=lambda r: not r.ok)
    )
    for each in {id(each): each for each in ordered}.values():
        for key, value in each.items():
            found.setdefault(key, value)
    return found


def by_test(
    runs: Sequence[Sequence[Record]],
    apart: Callable[[Sequence[Record]], list[list[Record]]] = configurations,
) -> list[dict[str, list[Record]]]:
    """Each run's records by what is repeated in it, under names that match between the runs.

    A name is the test's id, without its file where that leaves all apart: it depends on where
    pytest ran. A test that repeats several tasks, or one with other parameters, has several: the
    second of the first run is called `test_x[...] (stacking 2)`. `apart` splits the records of one
    test and task, which come in the order in which they were made.
    """
    whole = any(len({r.test for r in run}) > len({r.name for r in run}) for run in runs)
    of_run = [grouped(run, lambda r: (r.test if whole else r.name, r.task)) for run in runs]
    numbered = {
        key: _numbered([apart(groups.get(key, [])) for groups in of_run])
        for key in {*chain(*of_run)}
    }
    sides = [
        {(*key, k): group for key in groups for k, group in numbered[key][place].items()}
        for place, groups in enumerate(of_run)
    ]
    every = {key for side in sides for key in side}
    return [{_name(key, every): group for key, group in side.items()} for side in sides]


SAME: tuple[Callable[[tuple[str, str], tuple[str, str]], bool], ...] = (
    lambda a, b: a == b,
    lambda a, b: a[0] == b[0] != "",
    lambda a, b: a[1] == b[1],
    lambda a, b: True,
)
"""Which labels and parameters are of one configuration, the surest first."""


def _numbered(runs: Sequence[Sequence[list[Record]]]) -> list[dict[int, list[Record]]]:
    """The configurations of each run by number: those with the same label have the same one in all
    runs, then those with the same task parameters, then the rest by their order."""
    known: list[tuple[str, str]] = []
    sides = []
    for run, names in zip(runs, labels(runs), strict=True):
        side: dict[int, list[Record]] = {}
        rest = {k: (name, task_parameters(run[k][0])) for k, name in enumerate(names)}
        for same in SAME:
            for place, key in [*rest.items()]:
                alike = (k for k, other in enumerate(known, 1) if same(other, key))
                if number := next((k for k in alike if k not in side), None):
                    side[number] = run[place]
                    del rest[place]
        for place, key in rest.items():
            known.append(key)
            side[len(known)] = run[place]
        sides.append(side)
    return sides


def _name(key: tuple[str, str, int], every: set[tuple[str, str, int]]) -> str:
    test, task, number = key
    if sum(other[0] == test for other in every) == 1:
        return test
    return f"{test} ({task})" if number == 1 else f"{test} ({task} {number})"


def step_text(seconds: float) -> str:
    """A time step as ids and tables name it: `0.5ms`."""
    return f"{1e3 * seconds:.4g}ms"


def short(test: str) -> str:
    """A test's id without file and class."""
    name, bracket, parameters = test.partition("[")
    return name.rpartition("::")[2] + bracket + parameters


def side_by_side(
    records: Iterable[Record], name: str, others: Iterable[str]
) -> tuple[tuple[Record, ...], tuple[Record, ...]]:
    """One run as two: what a simulator scored, as the baseline of others, and what these scored.

    The records of the simulator of that name are given again as those of each other one: with its
    name, and the id of its test of the same function, variant, mode and profile. Where the other
    has no such test they keep the id that they have.
    """
    records, others = list(records), list(others)
    tests = {RowKey.of(record): record.test for record in records}
    before = [
        replace(record, simulator=other, test=tests.get(found, record.test))
        for other in others
        for record in records
        if record.simulator == name
        for found in [RowKey.of(record)._replace(simulator=other)]
    ]
    return tuple(before), tuple(record for record in records if record.simulator in others)
