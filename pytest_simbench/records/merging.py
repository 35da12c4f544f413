"""Several runs of the same tests with different seeds as one run: shards of several machines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

from pytest_simbench.records.configuration import differences, other_meanings, task_parameters
from pytest_simbench.records.description import TaskDescription, by_task
from pytest_simbench.records.record import Record
from pytest_simbench.records.series import by_test, configurations, grouped


class MergeError(ValueError):
    """Runs that make no single one; the message says why."""


@dataclass(frozen=True)
class Merged:
    """A record of the merged run, under its new number, and as it was in the run of that name."""

    record: Record
    run: str
    was: Record


def merge(runs: Mapping[str, Sequence[Record]]) -> list[Merged]:
    """The records of all runs, which have names, as of one, by test and seed.

    Repetition k of the whole has the k-th seed from the smallest of its test, as in a straight run.
    Interrupted repetitions are left out. Tests are matched without the path of their file where
    that leaves them apart: it depends on where pytest ran.

    Raises:
        MergeError: a run holds no repetition that ended, a seed is there twice, or settings or
            versions differ.
    """
    ended = [[r for r in run if r.status != "interrupted"] for run in runs.values()]
    for name, run in zip(runs, ended, strict=True):
        if not run:
            raise MergeError(f"{name} holds no repetition that ended: leave it out")
    tests: dict[str, dict[str, list[Record]]] = {}
    # A test may repeat several tasks, which their parameters tell apart.
    sides = by_test(ended, lambda records: list(grouped(records, task_parameters).values()))
    for name, groups in zip(runs, sides, strict=True):
        for test, found in groups.items():
            tests.setdefault(test, {})[name] = found
    merged: list[Merged] = []
    for test, parts in tests.items():
        _check(test, parts)
        every = [(record, name) for name, run in parts.items() for record in run]
        first = min(record.seed for record, _ in every)
        named = every[0][0]
        for record, name in sorted(every, key=lambda item: item[0].seed):
            number = record.seed - first + 1
            ours = replace(
                record, test=named.test, function=named.function, repetition=number, attempt=1
            )
            merged.append(Merged(ours, name, record))
    return merged


def merge_tasks(runs: Mapping[str, Mapping[str, TaskDescription]]) -> dict[str, TaskDescription]:
    """What the numbers of all runs, which have names, mean, by task.

    Raises:
        MergeError: a metric means one thing in one run and another in another.
    """
    for (a, first), (b, second) in combinations(runs.items(), 2):
        if said := other_meanings(first, second, "merge"):
            raise MergeError(
                f"{a} and {b} are not parts of one run: {'; '.join(said)} (the first is {a})"
            )
    return by_task(task for tasks in runs.values() for task in tasks.values())


def _check(test: str, parts: Mapping[str, Sequence[Record]]) -> None:
    for name, run in parts.items():
        groups = configurations(run)
        if len(groups) > 1:
            other = "; ".join(differences({test: (groups[0], groups[1])}, "merge"))
            raise MergeError(f"{name} holds several configurations: {other}")
        twice = len(run) - len({record.seed for record in run})
        if twice:
            raise MergeError(f"{name} has {twice} of its seeds of {test} twice")
    for (a, first), (b, second) in combinations(parts.items(), 2):
        shared = sorted({r.seed for r in first} & {r.seed for r in second})
        if shared:
            seeds = f"seed {shared[0]}" if len(shared) == 1 else f"{len(shared)} seeds"
            span = "" if len(shared) == 1 else f" ({shared[0]} to {shared[-1]})"
            raise MergeError(
                f"{a} and {b} overlap: both have {seeds}{span} of {test}; give each machine seeds "
                "of its own with --sim-seed"
            )
        # A repetition that failed at its start knows neither settings nor versions.
        known = [r for r in first if r.ok] or first, [r for r in second if r.ok] or second
        other_found = differences({test: known}, "merge")
        if other_found:
            raise MergeError(
                f"{a} and {b} are not parts of one run: {'; '.join(other_found)} (the first is {a})"
            )
