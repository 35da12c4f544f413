"""Which repetitions a replay shows side by side: those of one task and seed that have a trace."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from pytest_simbench.records.configuration import task_parameters
from pytest_simbench.records.paths import FolderError
from pytest_simbench.records.record import Record
from pytest_simbench.report.replay import REPLAY_NAME
from pytest_simbench.report.replay.recorded import trace_of


@dataclass
class Group:
    """Repetitions of one task with one seed.

    Attributes:
        shown: the repetitions, each with its trace.
    """

    task: str
    parameters: str
    seed: int
    shown: list[tuple[Record, Path]] = field(default_factory=list)


def groups(run: Path, records: Sequence[Record]) -> list[Group]:
    """Those of a run folder: the first seed of each task, then the others, in their order."""
    found: dict[tuple[str, str, int], Group] = {}
    for record in records:
        try:
            path = trace_of(run, record)
        except FolderError:
            continue
        if path is None:
            continue
        key = (record.task, task_parameters(record), record.seed)
        found.setdefault(key, Group(*key)).shown.append((record, path))
    tasks: dict[tuple[str, str], int] = {}
    placed = []
    for task, told, seed in sorted(found):
        place = tasks[task, told] = tasks.get((task, told), -1) + 1
        placed.append((place > 0, task, told, seed))
    return [found[key[1], key[2], key[3]] for key in sorted(placed)]


def links(shown: Sequence[Group]) -> dict[int, str]:
    """The address of each repetition's replay, beside the report, by `id(record)`."""
    return {id(r): f"{REPLAY_NAME}#{k}" for k, group in enumerate(shown) for r, _ in group.shown}
