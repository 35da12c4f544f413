"""`--sim-merge RUN...`: merge runs with different seeds into one run folder, and exit.
`--sim-report RUN...`: show runs again, from their folders alone, and exit.

The runs may come from anybody: of their folders only the records, what their numbers mean, and the
files beside them that records name are read, nothing outside, and every file written has a name of
ours.
"""

from __future__ import annotations

import os
import shutil
import stat
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

from pytest_simbench.experiment.identity import file_stem_of
from pytest_simbench.ground.text import for_terminal
from pytest_simbench.plugin import options, recording
from pytest_simbench.records.folder import RECORDS, TASKS, Reading, RunFolder
from pytest_simbench.records.merging import Merged, MergeError, merge, merge_tasks
from pytest_simbench.records.paths import FolderError, new_name, opened, whole
from pytest_simbench.records.record import Record, RecordError
from pytest_simbench.report.files import (
    Written,
    where,
    write_badge,
    write_files,
    write_outcome,
    write_report,
    write_tables,
)
from pytest_simbench.report.model import sweep
from pytest_simbench.report.model.outcome import Outcome
from pytest_simbench.report.model.report import Report
from pytest_simbench.report.page import PAGE_NAME
from pytest_simbench.report.terminal.parts import (
    claim_lines,
    history_lines,
    render_changes,
    render_tables,
    sweep_lines,
)
from pytest_simbench.report.terminal.run import render_brief, render_run


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
    def named(cls, config: pytest.Config, option: str) -> Runs:
        """Those that an option names.

        Raises:
            pytest.UsageError: one cannot be read, or is named twice.
        """
        flag = options.option(option).flag
        folders: dict[str, RunFolder] = {}
        readings: dict[str, Reading] = {}
        files: set[Path] = set()
        for name in options.value(config, option):
            path = Path(config.invocation_params.dir, name)
            file = (path / RECORDS if path.is_dir() else path).resolve()
            if file in files:
                raise pytest.UsageError(f"{flag} {name}: the run is given twice")
            folders[name] = RunFolder.of(path)
            with options.refusing(RecordError, f"{flag} {name}"):
                readings[name] = folders[name].read()
            files.add(file)
        return cls(folders, readings)

    def outcomes(self) -> tuple[list[Outcome], list[str]]:
        """How each ended, and what is wrong with what says so."""
        found = [Outcome.read(folder.path) for folder in self.folders.values()]
        return [outcome for outcome, _ in found], [problem for _, problem in found if problem]

    def merged(self, flag: str) -> tuple[list[Merged], Reading]:
        """Their records as those of one run: with where each comes from, and to be shown.

        Raises:
            pytest.UsageError: they are not parts of one run, or hold nothing.
        """
        with options.refusing(MergeError, flag):
            records = merge({name: found.records for name, found in self.readings.items()})
            tasks = merge_tasks({name: found.tasks for name, found in self.readings.items()})
        if not records:
            raise pytest.UsageError(f"{flag}: none of the runs holds a repetition that ended")
        return records, Reading(records=tuple(item.record for item in records), tasks=tasks)


def together(passed: Sequence[bool | None]) -> bool | None:
    """Whether the tests of several runs passed; None where one does not know."""
    if False in passed:
        return False
    return None if None in passed else True


def publish(config: pytest.Config, records: Sequence[Record], passed: bool | None) -> str:
    """Write the badge, if one is asked for; a sentence when it could not be written."""
    badge = options.value(config, "sim_badge")
    if not badge:
        return ""
    return write_badge(Path(config.invocation_params.dir, badge), records, passed)


def merge_runs(config: pytest.Config) -> int:
    """Merge the runs, print the result, and return the exit code.

    Raises:
        pytest.UsageError: a run that cannot be read, runs that are not parts of one, or a folder
            that already holds a run or cannot be written to.
    """
    runs = Runs.named(config, "sim_merge")
    records, whole = runs.merged("--sim-merge")
    folder = _locked(config)
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
        problems += recording.record(config, folder.path, folder.path, kept)
        passed = together([outcome.passed for outcome in outcomes])
        problems += [*wrong, write_outcome(folder.path, Outcome(passed, looks=looks))]
        problems.append(publish(config, kept, passed))
        _print(config, written, problems)
        if written.complete and not unsaved:
            print(where(folder.path / PAGE_NAME, config.invocation_params.dir))
    finally:
        folder.close()
    return 0


def report_runs(config: pytest.Config) -> int:
    """Show runs again: print the tables, write the report, and return the exit code.

    One run's report is written into its folder, or into `--sim-output`; that of several, which are
    merged for it, into `--sim-output` alone.

    Raises:
        pytest.UsageError: a run that cannot be read, or runs that are not parts of one.
    """
    runs = Runs.named(config, "sim_report")
    target = _target(config, list(runs.folders.values()))
    (first, folder), *others = runs.folders.items()
    whole = runs.merged("--sim-report")[1] if others else runs.readings[first]
    outcomes, wrong = runs.outcomes()
    looks = max(outcome.looks for outcome in outcomes)
    compared = None if others else outcomes[0].compared
    report = Report.of(whole, compared, looks)
    tables, problems = ([], []) if others else write_tables(folder.path, target)
    if not (whole.records or tables or problems):
        raise pytest.UsageError(f"--sim-report {first}: it holds no repetition")
    written = Written()
    if target is not None:
        written = write_files(target, report, None if others else folder.path)
    recorded = [*wrong, publish(config, whole.records, together([o.passed for o in outcomes]))]
    if target is not None and not others:
        recorded += recording.record(config, folder.path, target, whole.records)
    elif options.value(config, recording.RECORD):
        recorded.append("no recordings: join the runs with --sim-merge first")
    _print(config, report, [*runs.problems, *written.problems, *recorded])
    width = shutil.get_terminal_size().columns
    for line in history_lines(report.histories, width):
        print(for_terminal(line))
    if compared is not None:
        name, gate = compared
        text = render_changes(gate, width, bool(gate.changes))
        print(for_terminal(f"\nbaseline: {name}\n{text}"))
    if tables or problems:
        print(f"\n{render_tables(tables, width)}")
        for problem in problems:
            print(for_terminal(problem))
    if target is not None and written.complete:
        print(where(target / PAGE_NAME, config.invocation_params.dir))
    return 0 if written.complete else 1


def _target(config: pytest.Config, folders: list[RunFolder]) -> Path | None:
    """Where a report is written; None: nowhere.

    Raises:
        pytest.UsageError: that folder holds another run.
    """
    if not options.given(config, "sim_output"):
        return folders[0].path if len(folders) == 1 else None
    target = Path(config.invocation_params.dir, options.value(config, "sim_output"))
    own = len(folders) == 1 and target.resolve() == folders[0].path.resolve()
    if RunFolder(target).holds_run and not own:
        raise pytest.UsageError(
            f"--sim-report: {target} holds another run; give another --sim-output"
        )
    return target


def _print(config: pytest.Config, report: Report, problems: list[str]) -> None:
    verbose, width = config.get_verbosity() > 0, shutil.get_terminal_size().columns
    if report.claims:
        print(claim_lines(report.claims, width) + "\n")
    print((render_run if verbose else render_brief)(report.summaries, width))
    if report.sweeps:
        told = sweep_lines(report.sweeps, width, verbose)
        print("\n".join([f"\n{sweep.TITLE}", *map(for_terminal, told)]))
    for problem in filter(None, problems):
        print(for_terminal(problem))


def _locked(config: pytest.Config) -> RunFolder:
    given = options.value(config, "sim_output")
    folder = RunFolder(
        Path(config.invocation_params.dir, given)
        if given
        else new_name(config.rootpath / ".simbench", "-merged")
    )
    try:
        folder.lock()
        for name in (RECORDS, TASKS):
            folder.inside(name)
    except FolderError as error:
        folder.release()
        raise pytest.UsageError(f"--sim-merge: {error}") from None
    if folder.holds_run:
        folder.release()
        raise pytest.UsageError(
            f"--sim-merge: {folder.path} already holds a run; give another --sim-output"
        )
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
