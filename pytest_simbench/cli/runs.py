"""`simbench merge` and `simbench report`: runs with different seeds as one, and runs shown again.

The runs may come from anybody: of their folders only the records, what their numbers mean, and the
files beside them that records name are read, nothing outside, and every file written has a name of
ours.
"""

from __future__ import annotations

import argparse
import os
import shutil
import stat
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from pytest_simbench.cli.values import BadInput
from pytest_simbench.experiment.identity import file_stem_of
from pytest_simbench.ground.text import for_terminal
from pytest_simbench.measure.sweep import Swept
from pytest_simbench.records.folder import RECORDS, TASKS, Reading, RunFolder
from pytest_simbench.records.merging import Merged, MergeError, merge, merge_tasks
from pytest_simbench.records.paths import FolderError, new_name, opened, whole
from pytest_simbench.records.record import Record, RecordError
from pytest_simbench.report import history, repeatability, sweep
from pytest_simbench.report.brief import render_brief
from pytest_simbench.report.changes import render_terminal
from pytest_simbench.report.claims import Claims, claims_of
from pytest_simbench.report.claims import lines as lines_of
from pytest_simbench.report.files import (
    Written,
    in_order,
    shown,
    summaries_of,
    where,
    write_badge,
    write_files,
    write_outcome,
    write_report,
)
from pytest_simbench.report.outcome import Outcome
from pytest_simbench.report.page import PAGE_NAME
from pytest_simbench.report.progress import Progress
from pytest_simbench.report.recorded import FOLDER, write_bags
from pytest_simbench.report.summary import TaskSummary
from pytest_simbench.report.tables import render_run

RUNS = ".simbench"
"""Where runs lie for which no folder is given."""


@contextmanager
def _refused(error: type[Exception], where: str = "") -> Iterator[None]:
    """Make bad input of such errors in this block, after `WHERE: `."""
    try:
        yield
    except error as reason:
        raise BadInput(f"{where}: {reason}" if where else str(reason)) from None


@dataclass(frozen=True)
class Wanted:
    """What is wanted of runs besides their tables.

    Attributes:
        output: folder to write to; None for the one of a single run, or a new one.
        badge: file to write a badge into.
        record: whether recordings of their motions are written.
        verbose: whether whole tables are printed.
    """

    output: str | None = None
    badge: str | None = None
    record: bool = False
    verbose: bool = False

    @classmethod
    def of(cls, given: argparse.Namespace) -> Wanted:
        """What a command line says."""
        return cls(given.output, given.badge, bool(given.record), given.verbose)


@dataclass(frozen=True)
class Runs:
    """Runs that a user named.

    Attributes:
        folders: of each, by its name.
        readings: what each holds, by its name.
    """

    folders: dict[str, RunFolder]
    readings: dict[str, Reading]

    @property
    def problems(self) -> list[str]:
        """What is wrong with them, one sentence each."""
        return [text for reading in self.readings.values() for text in reading.problems]

    @classmethod
    def named(cls, names: Sequence[str]) -> Runs:
        """Those of these folders, or files of records.

        Raises:
            BadInput: one cannot be read, or is named twice.
        """
        folders: dict[str, RunFolder] = {}
        readings: dict[str, Reading] = {}
        files: set[Path] = set()
        for name in names:
            path = Path(name)
            file = (path / RECORDS if path.is_dir() else path).resolve()
            if file in files:
                raise BadInput(f"{name}: the run is given twice")
            folders[name] = RunFolder.of(path)
            with _refused(RecordError, name):
                readings[name] = folders[name].read()
            files.add(file)
        return cls(folders, readings)

    def outcomes(self) -> tuple[list[Outcome], list[str]]:
        """How each ended, and what is wrong with what says so."""
        found = [Outcome.read(folder.path) for folder in self.folders.values()]
        return [outcome for outcome, _ in found], [problem for _, problem in found if problem]

    def merged(self) -> tuple[list[Merged], Reading]:
        """Their records as those of one run: with where each comes from, and to be shown.

        Raises:
            BadInput: they are not parts of one run, or hold nothing.
        """
        with _refused(MergeError):
            records = merge({name: found.records for name, found in self.readings.items()})
            tasks = merge_tasks({name: found.tasks for name, found in self.readings.items()})
        if not records:
            raise BadInput("none of the runs holds a repetition that ended")
        return records, Reading(records=tuple(item.record for item in records), tasks=tasks)


def together(passed: Sequence[bool | None]) -> bool | None:
    """Whether the tests of several runs passed; None where one does not know."""
    if False in passed:
        return False
    return None if None in passed else True


def merge_runs(names: Sequence[str], wanted: Wanted) -> int:
    """Merge the runs, print the result, and return the exit code.

    Raises:
        BadInput: a run that cannot be read, runs that are not parts of one, or a folder that
            already holds a run or cannot be written to.
    """
    runs = Runs.named(names)
    records, whole = runs.merged()
    folder = _locked(wanted.output)
    try:
        for task in whole.tasks.values():
            folder.describe(task)
        refused = _copy(records, runs.folders, folder)
        unsaved = folder.flush()
        outcomes, wrong = runs.outcomes()
        looks = max(outcome.looks for outcome in outcomes)
        written = write_report(folder, looks=looks)
        problems = [*runs.problems, *refused, *unsaved, *written.problems]
        kept = [item.record for item in records]
        if wanted.record:
            problems += recordings(folder.path, folder.path, kept)
        passed = together([outcome.passed for outcome in outcomes])
        problems += [*wrong, write_outcome(folder.path, Outcome(passed, looks=looks))]
        problems.append(badge(wanted.badge, kept, passed))
        _print(wanted, written.summaries, written.sweeps, problems, written.claims)
        if written.complete and not unsaved:
            print(where(folder.path / PAGE_NAME, Path.cwd()))
    finally:
        folder.close()
    return 0


def report_runs(names: Sequence[str], wanted: Wanted) -> int:
    """Show runs again: print the tables, write the report, and return the exit code.

    One run's report is written into its folder, or into the one that is wanted; that of several,
    which are merged for it, into the one that is wanted alone.

    Raises:
        BadInput: a run that cannot be read, or runs that are not parts of one.
    """
    runs = Runs.named(names)
    target = _target(wanted.output, list(runs.folders.values()))
    (first, folder), *others = runs.folders.items()
    whole = runs.merged()[1] if others else runs.readings[first]
    outcomes, wrong = runs.outcomes()
    looks = max(outcome.looks for outcome in outcomes)
    summaries, written = summaries_of(whole, looks), Written()
    histories, sweeps = history.of_run(whole), sweep.of_run(whole)
    tables, problems = ([], []) if others else repeatability.write_tables(folder.path, target)
    if not (whole.records or tables or problems):
        raise BadInput(f"{first}: it holds no repetition")
    compared = None if others else outcomes[0].compared
    claims = claims_of(whole, compared[1] if compared else None)
    if target is not None:
        written = write_files(
            target,
            summaries,
            in_order(whole.records),
            True,
            compared,
            None if others else folder.path,
            histories,
            sweeps,
            claims,
        )
    passed = together([outcome.passed for outcome in outcomes])
    told = [*runs.problems, *written.problems, *wrong, badge(wanted.badge, whole.records, passed)]
    if wanted.record and target is not None and not others:
        told += recordings(folder.path, target, whole.records)
    elif wanted.record:
        told.append("no recordings: join the runs with simbench merge first")
    _print(wanted, summaries, sweeps, told, claims)
    width = shutil.get_terminal_size().columns
    for line in history.lines(histories, width):
        print(for_terminal(line))
    if compared is not None:
        name, report = compared
        text = render_terminal(report, width, bool(report.changes))
        print(for_terminal(f"\nbaseline: {name}\n{text}"))
    if tables or problems:
        print(f"\n{repeatability.render_terminal(tables, width)}")
        for problem in problems:
            print(for_terminal(problem))
    if target is not None and written.complete:
        print(where(target / PAGE_NAME, Path.cwd()))
    return 0 if written.complete else 1


def badge(file: str | None, records: Sequence[Record], passed: bool | None) -> str:
    """Write the badge, if one is asked for; a sentence when it could not be written."""
    return write_badge(Path(file), records, passed) if file else ""


def recordings(
    run: Path, target: Path, records: Sequence[Record], progress: Progress | None = None
) -> list[str]:
    """Write the motions of a run as rosbag2 folders.

    Args:
        run: its folder, which holds the traces.
        target: folder to write to.
        records: of the run.
        progress: the live line; None: one on standard output.

    Returns:
        Lines for the terminal.
    """
    count, problems = write_bags(run, target, records, progress or _printed())
    if not count:
        return [*problems, "no recordings: the run has no traces; see --sim-trace"]
    many = f"{count} recording{'s' if count > 1 else ''}"
    return [*problems, f"{many}: {shown(target / FOLDER, Path.cwd())}"]


def _printed() -> Progress:
    def write(text: str) -> None:
        print(text, end="", flush=True)

    return Progress(write, sys.stdout.isatty(), shutil.get_terminal_size().columns)


def _target(output: str | None, folders: list[RunFolder]) -> Path | None:
    """Where a report is written; None: nowhere.

    Raises:
        BadInput: that folder holds another run.
    """
    if output is None:
        return folders[0].path if len(folders) == 1 else None
    target = Path(output)
    own = len(folders) == 1 and target.resolve() == folders[0].path.resolve()
    if RunFolder(target).holds_run and not own:
        raise BadInput(f"{target} holds another run; give another --output")
    return target


def _print(
    wanted: Wanted,
    summaries: Sequence[TaskSummary],
    sweeps: Sequence[Swept],
    problems: list[str],
    claims: Claims | None,
) -> None:
    width = shutil.get_terminal_size().columns
    if claims:
        print(lines_of(claims, width) + "\n")
    print((render_run if wanted.verbose else render_brief)(summaries, width))
    if sweeps:
        told = (sweep.whole if wanted.verbose else sweep.brief)(sweeps, width)
        print("\n".join([f"\n{sweep.TITLE}", *map(for_terminal, told)]))
    for problem in filter(None, problems):
        print(for_terminal(problem))


def _locked(output: str | None) -> RunFolder:
    folder = RunFolder(Path(output) if output else new_name(Path(RUNS), "-merged"))
    try:
        folder.lock()
        for name in (RECORDS, TASKS):
            folder.inside(name)
    except FolderError as error:
        folder.release()
        raise BadInput(str(error)) from None
    if folder.holds_run:
        folder.release()
        raise BadInput(f"{folder.path} already holds a run; give another --output")
    return folder


BESIDE = ("traces/{}.npz", "pictures/{}.npz", "videos/{}.mp4")
"""What else a run folder may hold of a repetition, named as its log is."""


def _copy(records: list[Merged], folders: dict[str, RunFolder], to: RunFolder) -> list[str]:
    """Write the records, with their logs and what else there is of them (`BESIDE`) under the names
    that they have in the whole.

    Returns:
        What was refused, one sentence each.
    """
    refused: dict[str, None] = {}
    for item in records:
        was, stem, folder = file_stem_of(item.was), file_stem_of(item.record), folders[item.run]
        kept, log = "", item.was.notes.log
        for source, target in (
            (log, f"logs/{stem}.log"),
            *((name.format(was), name.format(stem)) for name in BESIDE),
        ):
            try:
                if source and _copied(folder, source, to, target) and source == log:
                    kept = target
            except FolderError as error:
                refused.setdefault(f"not copied: {error}")
        to.append(item.record.noting(log=kept))
    return list(refused)


def _copied(folder: RunFolder, source: str, to: RunFolder, target: str) -> bool:
    """Copy an ordinary file; a log that is missing makes no result wrong.

    Raises:
        FolderError: one of them would lie outside of its folder.
    """
    folder.inside(source), to.inside(target)
    try:
        with open(opened(folder.path, source), "rb") as old:
            if not stat.S_ISREG(os.fstat(old.fileno()).st_mode):
                return False
            with whole(to.path, target) as new:
                shutil.copyfileobj(old, new)
    except OSError:
        return False
    return True
