"""The run folder: what is recorded of a run, and what its numbers mean, written and read back.

    records.jsonl      a line for each repetition (`record`)
    tasks.jsonl        what each task's metrics and references mean (`description`); the lines of
                       one task hold together, and of one metric the last one
    thresholds.jsonl   thresholds that tests asked for
    claims.jsonl       what tests claimed, and what came of it (`claims`)
    repeatability.jsonl, logs, traces, report.md, ...

Report, merge, resume, baseline and gate need the folder alone, never the code that made it.
"""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from pytest_simbench.records import lines
from pytest_simbench.records.claims import Claim
from pytest_simbench.records.configuration import other_meanings
from pytest_simbench.records.description import Describing, TaskDescription, Threshold, by_task
from pytest_simbench.records.lines import DAMAGED, LARGEST_LINE, Found, LinesFile, UnreadableError
from pytest_simbench.records.lock import FolderLock
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.paths import FolderError, inside
from pytest_simbench.records.record import Record, RecordError
from pytest_simbench.records.series import settled

RECORDS = "records.jsonl"
TASKS = "tasks.jsonl"
THRESHOLDS = "thresholds.jsonl"
CLAIMS = "claims.jsonl"

HOLD_RESULTS = (RECORDS, "repeatability.jsonl")
"""Files that make a folder one that holds a run."""

NOUNS = {RECORDS: "record", TASKS: "task description", THRESHOLDS: "threshold", CLAIMS: "claim"}


@dataclass(frozen=True)
class RunContents:
    """What a run holds.

    Attributes:
        name: where it comes from, as the user reads it.
        records: those that count, in their order, see `series.settled`.
        tasks: what the metrics mean, by the name of their task.
        thresholds: that tests asked for.
        claims: of tests, in the order in which they were judged.
        problems: damaged lines and descriptions that cannot be used, one sentence each; they are
            left out.
        refused: whole lines that are no records of ours, one sentence each.
        every: also records that do not count: earlier attempts, interrupted repetitions that were
            run again.
    """

    name: str = ""
    records: tuple[Record, ...] = ()
    tasks: Mapping[str, TaskDescription] = field(default_factory=dict)
    thresholds: tuple[Threshold, ...] = ()
    claims: tuple[Claim, ...] = ()
    problems: tuple[str, ...] = ()
    refused: tuple[str, ...] = ()
    every: tuple[Record, ...] = ()

    @property
    def metrics(self) -> dict[str, tuple[Metric, ...]]:
        """The metrics of each task, by its name."""
        return {name: task.metrics for name, task in self.tasks.items()}

    @property
    def references(self) -> dict[str, Mapping[str, float]]:
        """The references of each task, by its name."""
        return {name: task.references for name, task in self.tasks.items()}


class RunFolder:
    """One run's folder.

    To write, `lock` it first. What a full disk or a lost folder does not take stays in this
    object and is read back from it.

    Attributes:
        own: records that this process made or took over, as they came.
    """

    def __init__(self, path: Path, records: str = RECORDS) -> None:
        self.path = path
        self.own: list[Record] = []
        self._records = records
        self._folder_lock: FolderLock | None = None
        self._files: dict[str, LinesFile] = {}
        self._spare = lines.spare_folder()
        self._described: dict[str, TaskDescription] = {}
        self._asked: dict[Threshold, None] = {}
        self._claims: list[Claim] = []
        self._lock = threading.RLock()

    @classmethod
    def of(cls, path: Path) -> RunFolder:
        """The folder that a user means by its path, or by that of its record file."""
        if not os.path.isfile(path):
            return cls(path)
        file = path.resolve() if path.is_symlink() else path  # what a user names may be a link
        return cls(file.parent, file.name)

    def inside(self, name: str) -> Path:
        """The path of a file of this folder.

        Raises:
            FolderError: it leads out of the folder.
        """
        return inside(self.path, name)

    @property
    def holds_run(self) -> bool:
        """Whether something was recorded in it."""
        paths = [self.path / name for name in HOLD_RESULTS]
        return any(os.path.exists(path) and os.path.getsize(path) for path in paths)

    @property
    def locked(self) -> bool:
        """Whether this process may write to it."""
        return self._folder_lock is not None

    @property
    def used(self) -> bool:
        """Whether this process has kept or taken over anything of it."""
        return bool(self.own or self._asked or self._described)

    def lock(self, *, shared: bool = False) -> None:
        """Make it this run's own until `close`; `shared` by its processes (xdist's workers).

        Raises:
            FolderError: it cannot be written to, or another run is under way in it.
        """
        if self._folder_lock is None:
            self._folder_lock = FolderLock(self.path, shared=shared)
            for name in () if shared or self.holds_run else (TASKS, THRESHOLDS, CLAIMS):
                with suppress(OSError, FolderError):  # of a run that recorded nothing
                    self.inside(name).unlink()

    def release(self) -> None:
        """Give it up; a folder made for nothing goes away."""
        if self._folder_lock is not None:
            self._folder_lock.close()
            self._folder_lock = None

    def close(self) -> tuple[str, ...]:
        """Write what waits, and give the folder up; may be called again.

        Returns:
            What was not written here and where it is, as lines for the terminal.
        """
        told = self.flush()
        self.release()
        return told

    def flush(self) -> tuple[str, ...]:
        """Try once more to write what waits, else elsewhere; the lines that `close` returns."""
        with self._lock:
            found = [file.close() for file in self._files.values()]
        return tuple(text for part in found for text in (*part.problems, *part.unsaved))

    def append(self, record: Record) -> None:
        """Keep a record, on the disk before this returns if that can be. Never raises OSError."""
        line = record.to_json()
        if len(line) >= LARGEST_LINE:  # no reader would take it
            note = f"{len(line)} bytes, more than a record may have"
            line = replace(record.noting(left_out=note), details={}).to_json()
        with self._lock:
            self.own.append(record)
            self._write(self._records, line)

    def take_over(self, records: Iterable[Record]) -> None:
        """Count records that another process wrote as this one's."""
        with self._lock:
            self.own += records

    def describe(self, task: Describing | TaskDescription) -> None:
        """Write what a task's numbers mean, unless the folder says so already.

        Raises:
            RecordError: another task of that name has numbers that mean something else.
        """
        found = task if isinstance(task, TaskDescription) else TaskDescription.of(task)
        with self._lock:
            here = self._described.get(found.task)
            if here is not None and by_task([here, found])[found.task] == here:
                return
            known = self._tasks([])
            if said := other_meanings(known, {found.task: found}, "merge"):
                raise RecordError(
                    f"{'; '.join(said)}: another task of this run is named {found.task} too; give "
                    "one of them a `name` of its own"
                )
            whole = by_task([*known.values(), found])[found.task]
            self._described[found.task] = whole
            if whole != known.get(found.task):
                self._write(TASKS, json.dumps(whole.to_dict()))

    def ask(self, threshold: Threshold) -> None:
        """Write a threshold that a test asked for."""
        with self._lock:
            if threshold not in self._asked:
                self._asked[threshold] = None
                self._write(THRESHOLDS, json.dumps(threshold.to_dict()))

    def claim(self, claim: Claim) -> None:
        """Keep what came of a claim."""
        with self._lock:
            self._claims.append(claim)
            self._write(CLAIMS, json.dumps(claim.to_dict()))

    def claims(self, problems: list[str]) -> tuple[Claim, ...]:
        """As they were judged; `problems` takes what is wrong with their lines."""
        return (*self._parsed(CLAIMS, Claim, problems), *self._claims)

    def _write(self, name: str, line: str) -> None:
        if name not in self._files:
            noun = NOUNS.get(name, "record")
            self._files[name] = LinesFile(self.path, name, self._spare, noun)
        self._files[name].append(line)

    def read(self) -> RunContents:
        """What the folder holds. Damaged lines are left out, each with a problem.

        Raises:
            RecordError: there are no records, a whole line is none, or every line is damaged.
        """
        found = self.scan()
        if found.refused:
            raise RecordError(found.refused[0])
        if not found.every and (damaged := self._found().problems):
            raise RecordError(damaged[0].replace(DAMAGED, ""))
        return found

    def scan(self) -> RunContents:
        """The same, with what is wrong told instead of raised."""
        path = self.path / self._records
        try:
            found = self._found()
        except RecordError as error:
            lost = self.own and not os.path.exists(path)  # the folder is gone, and was told of
            found = Found(refused=() if lost else (str(error),))
        problems = list(found.problems)
        # Those in memory come last: they are there although the disk may be full.
        records = settled([*found.items, *self.own])
        tasks = self._tasks(problems)
        asked = dict.fromkeys([*self._parsed(THRESHOLDS, Threshold, problems), *self._asked])
        claims = self.claims(problems)
        return RunContents(
            name=str(self.path if self._records == RECORDS else path),
            records=tuple(records),
            tasks=tasks,
            thresholds=tuple(asked),
            claims=claims,
            problems=tuple(problems),
            refused=found.refused,
            every=found.items,
        )

    def _tasks(self, problems: list[str]) -> dict[str, TaskDescription]:
        """What the numbers of each task mean; `problems` takes what is wrong with their lines."""
        found: dict[str, TaskDescription] = {}
        for task in (*self._parsed(TASKS, TaskDescription, problems), *self._described.values()):
            said = other_meanings(found, {task.task: task}, "merge")
            problems += [f"{self.path / TASKS}: {text}; the last one holds" for text in said]
            found |= by_task([*filter(None, [found.get(task.task)]), task])
        return found

    def _parsed(self, name: str, kind: Any, problems: list[str]) -> tuple[Any, ...]:
        """The items of a file beside the records, which may be missing."""
        if self._records != RECORDS or not os.path.lexists(self.path / name):
            return ()
        try:
            found = lines.read(self.path, name, kind.from_dict)
        except UnreadableError as error:
            problems.append(str(error))
            return ()
        problems += [*found.problems, *found.refused]
        return found.items

    def repair(self) -> tuple[Path, ...]:
        """Write its files anew without damaged lines; the old ones stay beside them.

        Returns:
            The copies of the damaged files.

        Raises:
            OSError: the folder cannot be written to.
        """
        repaired = []
        for name in (self._records, TASKS, THRESHOLDS, CLAIMS, *HOLD_RESULTS[1:]):
            with suppress(UnreadableError):  # there is none that is read
                repaired.append(lines.repair(self.path, name))
        return tuple(kept for kept in repaired if kept is not None)

    def _found(self) -> Found[Record]:
        """The lines of the record file.

        Raises:
            RecordError: it cannot be read.
        """
        path = self.path / self._records
        try:
            if self.holds_run and not os.path.lexists(path):
                return Found()  # of its kind a run without repetitions of tasks
            return lines.read(self.path, self._records, Record.from_dict)
        except UnreadableError as error:
            raise RecordError(
                f"cannot read records from {path} ({error.reason}); give a run folder or its "
                f"{RECORDS}"
            ) from None
