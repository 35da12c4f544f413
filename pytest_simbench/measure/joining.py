"""Several runs of the same tests with different seeds as one run: shards of several machines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

from pytest_simbench.measure.differences import differences
from pytest_simbench.measure.record import Record

SAME = ("profile", "protocol", "jitter", "deviations", "settings", "versions")
"""What of a record must be the same in runs that are joined; machines may differ."""


class JoinError(ValueError):
    """Runs that make no single one; the message says why."""


@dataclass(frozen=True)
class Joined:
    """A record of the joined run.

    Attributes:
        record: under its new number.
        run: name of the run that it comes from.
        number: its repetition there.
    """

    record: Record
    run: str
    number: int


def join(runs: Mapping[str, Sequence[Record]]) -> list[Joined]:
    """The records of all runs as of one, by test and seed.

    Repetition k of the whole has the k-th seed from the smallest of its test, as in a straight run.
    Interrupted repetitions are left out. Tests are matched without the path of their file where
    that leaves them apart: it depends on where pytest ran.

    Args:
        runs: records by the name of their run.

    Raises:
        JoinError: a seed is there twice, or settings or versions differ.
    """
    ended = {name: [r for r in run if r.status != "interrupted"] for name, run in runs.items()}
    whole = any(
        len({r.test for r in run}) > len({_short(r.test) for r in run}) for run in ended.values()
    )
    tests: dict[str, dict[str, list[Record]]] = {}
    for name, run in ended.items():
        for record in run:
            key = record.test if whole else _short(record.test)
            tests.setdefault(key, {}).setdefault(name, []).append(record)
    found: list[Joined] = []
    for test, parts in tests.items():
        _check(test, parts)
        every = [(record, name) for name, run in parts.items() for record in run]
        first = min(record.seed for record, _ in every)
        id_ = every[0][0].test
        for record, name in sorted(every, key=lambda item: item[0].seed):
            number = record.seed - first + 1
            found.append(Joined(_renumbered(record, number, id_), name, record.repetition))
    return found


def _check(test: str, parts: Mapping[str, Sequence[Record]]) -> None:
    for name, run in parts.items():
        twice = len(run) - len({record.seed for record in run})
        if twice:
            raise JoinError(f"{name} has {twice} of its seeds of {test} twice")
    for (a, first), (b, second) in combinations(parts.items(), 2):
        shared = sorted({r.seed for r in first} & {r.seed for r in second})
        if shared:
            seeds = f"seed {shared[0]}" if len(shared) == 1 else f"{len(shared)} seeds"
            span = "" if len(shared) == 1 else f" ({shared[0]} to {shared[-1]})"
            raise JoinError(
                f"{a} and {b} overlap: both have {seeds}{span} of {test}; give each machine seeds "
                "of its own with --sim-seed"
            )
        # A repetition that failed at its start knows neither settings nor versions.
        known = [r for r in first if r.ok], [r for r in second if r.ok]
        other = differences({test: known}, SAME) if all(known) else []
        if other:
            raise JoinError(
                f"{a} and {b} are not parts of one run: {'; '.join(other)} (the first is {a})"
            )


def _renumbered(record: Record, number: int, test: str) -> Record:
    details = dict(record.details)
    if details.get("log"):
        details["log"] = file_of(str(details["log"]), record.repetition, number)
    return replace(record, test=test, repetition=number, details=details)


def file_of(name: str, old: int, new: int) -> str:
    """A repetition's file (`logs/test-3.log`) under another number."""
    stem, _, ending = name.rpartition(f"-{old}.")
    return f"{stem}-{new}.{ending}" if stem else name


def _short(test: str) -> str:
    return test.rpartition("::")[2]
