"""`simbench merge` and `simbench report`: runs with different seeds as one, and runs shown again.

The runs may come from anybody: of their folders only the records, what their numbers mean, and the
files beside them that records name are read, nothing outside, and every file written has a name of
ours.
"""

from __future__ import annotations

import os
import shutil
import stat
import sys
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

from pytest_simbench.cli.values import BadInput, refusing
from pytest_simbench.description.carried import keep, kept
from pytest_simbench.experiment.identity import file_stem_of
from pytest_simbench.ground.text import for_terminal, in_one_line
from pytest_simbench.measure.settling import TASK as SETTLING
from pytest_simbench.records.folder import RECORDS, TASKS, RunContents, RunFolder
from pytest_simbench.records.merging import Merged, MergeError, merge, merge_tasks
from pytest_simbench.records.paths import FolderError, new_name, opened, whole
from pytest_simbench.records.record import Record, RecordError
from pytest_simbench.records.repeatability import NAME
from pytest_simbench.report.files import (
    Written,
    shown,
    where,
    write_badge,
    write_files,
    write_outcome,
    write_tables,
)
from pytest_simbench.report.model import sweep, transfer
from pytest_simbench.report.model.outcome import RunOutcome
from pytest_simbench.report.model.report import Report
from pytest_simbench.report.page import PAGE_NAME
from pytest_simbench.report.replay.recorded import FOLDER, write_bags
from pytest_simbench.report.terminal.grid import fill
from pytest_simbench.report.terminal.parts import (
    claim_lines,
    render_changes,
    render_histories,
    render_tables,
    sweep_lines,
)
from pytest_simbench.report.terminal.progress import Progress
from pytest_simbench.report.terminal.run import render_brief, render_run, render_section, warnings
from pytest_simbench.scene.pair_friction import OF_PAIRS

RUNS = ".simbench"
"""Where runs lie for which no folder is given."""


Folders = dict[str, RunFolder]
"""Of runs, by the names that a user gave."""


def _read(names: Sequence[str]) -> tuple[Folders, dict[str, RunContents]]:
    """Folders of runs, or of files of records, and what each holds.

    Raises:
        BadInput: one cannot be read, or is named twice.
    """
    folders: Folders = {}
    readings: dict[str, RunContents] = {}
    files: set[Path] = set()
    for name in names:
        path = Path(name)
        file = (path / RECORDS if path.is_dir() else path).resolve()
        if file in files:
            raise BadInput(f"{name}: the run is given twice")
        folders[name] = RunFolder.of(path)
        with refusing(RecordError, name):
            readings[name] = folders[name].read()
        files.add(file)
    return folders, readings


def _outcome(folders: Folders, readings: dict[str, RunContents]) -> tuple[RunOutcome, list[str]]:
    """How runs ended together, and what is wrong with their files. Whether the tests passed is not
    known where one run does not know or where one has claims: parts may be too small to decide what
    the whole decides. A comparison is that of one run alone."""
    found = [RunOutcome.read(folder.path) for folder in folders.values()]
    wrong = [text for reading in readings.values() for text in reading.problems]
    wrong += [text for _, text in found if text]
    outcomes = [outcome for outcome, _ in found]
    if len(outcomes) == 1:
        return outcomes[0], wrong
    beside = [name for name, folder in folders.items() if (folder.path / NAME).is_file()]
    wrong += [f"{name}: what it found on repeatability is of that run alone" for name in beside]
    passed = [outcome.passed for outcome in outcomes]
    unknown = None in passed or any(reading.claims for reading in readings.values())
    together = False if False in passed else None if unknown else True
    ended = all(outcome.ended for outcome in outcomes)
    looks = max(outcome.looks for outcome in outcomes)
    cut = tuple(sorted({test for one in outcomes for test in (*one.cut, *one.open)}))
    return RunOutcome(together, looks=looks, ended=ended, cut=cut), wrong


def _merged(readings: dict[str, RunContents]) -> tuple[list[Merged], RunContents]:
    """The records of runs as those of one: with where each comes from, and to be shown.

    Raises:
        BadInput: they are not parts of one run, or one holds nothing.
    """
    with refusing(MergeError):
        records = merge({name: found.records for name, found in readings.items()})
        tasks = merge_tasks({name: found.tasks for name, found in readings.items()})
    return records, RunContents(records=tuple(item.record for item in records), tasks=tasks)


def merge_runs(
    runs: Sequence[str], output: str | None = None, verbose: bool = False, **more: str | None
) -> int:
    """Merge runs, print the result, and return the exit code.

    Args:
        runs: their folders.
        output: folder to write to; None for a new one.
        verbose: whether whole tables are printed.
        more: see `_show`.

    Raises:
        BadInput: a run that cannot be read, runs that are not parts of one, or a folder that
            already holds a run or cannot be written to.
    """
    folders, readings = _read(runs)
    records, merged = _merged(readings)
    with closing(_locked(output)) as folder:
        for task in merged.tasks.values():
            folder.describe(task)
        for part in folders.values():
            for name, account in kept(part.path).items():
                keep(folder.path, part.path / name, account)  # named by the part where two differ
        refused = _copy(records, folders, folder)
        unsaved = folder.flush()
        found, wrong = _outcome(folders, readings)
        outcome = replace(found, compared=None)
        problems = [*wrong, *refused, *unsaved, write_outcome(folder.path, outcome)]
        if any(reading.claims for reading in readings.values()):
            problems.append(f"pytest --sim-resume={folder.path} judges the claims of the whole")
        written = _show(folder.read(), outcome, folder.path, folder.path, verbose, problems, **more)
        if complete := written.complete and not unsaved:
            print(where(folder.path / PAGE_NAME, Path.cwd()))
    return 0 if complete else 1


def report_runs(
    runs: Sequence[str], output: str | None = None, verbose: bool = False, **more: str | None
) -> int:
    """Show runs again: print the tables, write the report, and return the exit code.

    One run's report is written into its folder, or into `output`; that of several, which are merged
    for it, into `output` alone. See `merge_runs`.

    Raises:
        BadInput: a run that cannot be read, or runs that are not parts of one.
    """
    folders, readings = _read(runs)
    target = _target(output, list(folders.values()))
    (first, folder), *others = folders.items()
    run = None if others else folder.path
    reading = _merged(readings)[1] if others else readings[first]
    outcome, wrong = _outcome(folders, readings)
    tables, untold = ([], []) if run is None else write_tables(run, target)
    if not (reading.records or tables or untold):
        raise BadInput(f"{first}: it holds no repetition")
    written = _show(reading, outcome, run, target, verbose, wrong, **more)
    width = shutil.get_terminal_size().columns
    if outcome.compared is not None:
        name, gate = outcome.compared
        text = render_changes(gate, width, bool(gate.changes))
        print(for_terminal(f"\nbaseline: {name}\n{text}"))
    if tables or untold:
        print(f"\n{render_tables(tables, width)}")
        print(*map(for_terminal, untold), sep="\n")
    if target is not None and written.complete:
        print(where(target / PAGE_NAME, Path.cwd()))
    return 0 if written.complete else 1


def sections(written: Report, width: int, verbose: bool) -> Iterator[tuple[str, str]]:
    """What a terminal of so many columns shows of a result: titles, and the text below each; whole
    tables where `verbose`."""
    for scene in written.scenes:
        yield scene.title.lower(), for_terminal(render_section(scene, width, titled=False))
    for policies in map(transfer.section, written.transfers):
        shown = replace(policies, tables=policies.tables[: None if verbose else 1])
        yield shown.title.lower(), for_terminal(render_section(shown, width, titled=False))
    if written.summaries or written.sweeps:
        claims = [claim_lines(written.claims, width), ""] if written.claims else []
        brief = [s for s in written.summaries if s.task != SETTLING or not written.settled]
        table = render_run(written.summaries, width) if verbose else render_brief(brief, width)
        alone = [s for s in written.summaries if s not in brief and not verbose]
        pairs = [in_one_line(line) for line in warnings(alone) if OF_PAIRS in line]
        told = for_terminal("\n".join(fill(line, width, "  ") for line in pairs))
        yield "simulator comparison", "\n".join([*claims, table, *filter(None, [told])])
    if written.sweeps:
        yield sweep.TITLE, for_terminal("\n".join(sweep_lines(written.sweeps, width, verbose)))
    if written.histories:
        yield "history", for_terminal(render_histories(written.histories, width))


def text_of(report: Report, width: int, verbose: bool) -> str:
    """The same as one text, without the first title."""
    (_, first), *others = [*sections(report, width, verbose)] or [("", "")]
    return "\n".join([first, *(f"\n{title}\n{text}" for title, text in others)])


def _show(
    reading: RunContents,
    outcome: RunOutcome,
    run: Path | None,
    target: Path | None,
    verbose: bool,
    problems: list[str],
    badge: str | None = None,
    record: str | None = None,
) -> Written:
    """Write the report of a run into `target`, the badge into the file `badge`, and with `record`
    recordings of the motions, where they are wanted; and print tables and problems."""
    report = Report.of(reading, outcome)
    written = Written(**vars(report)) if target is None else write_files(target, report, run)
    known = reading.records, outcome.passed, reading.claims
    lost = write_badge(Path(badge), *known) if badge else ""
    problems += [*written.problems, lost]
    complete = written.complete and not lost
    if record and run is not None and target is not None:
        told, recorded = recordings(run, target, reading.records)
        problems += told
        complete &= recorded
    elif record:
        problems.append("no recordings: join the runs with simbench merge first")
    print(text_of(written, shutil.get_terminal_size().columns, verbose))
    for problem in filter(None, problems):
        print(for_terminal(problem))
    return replace(written, complete=complete)


def recordings(
    run: Path, target: Path, records: Sequence[Record], progress: Progress | None = None
) -> tuple[list[str], bool]:
    """Write the motions of a run, whose folder holds the traces, as rosbag2 folders into another
    one; lines for the terminal, and whether every trace has one. Without a live line there is one
    on standard output."""
    count, problems = write_bags(run, target, records, progress or printed())
    many = f"{count} recording{'s' if count > 1 else ''}: {shown(target / FOLDER, Path.cwd())}"
    if not count:
        many = "" if problems else "no recordings: the run has no traces; see --sim-trace"
    return [*problems, many], not problems


def printed(quiet: bool = False) -> Progress:
    """The live line on standard output; a notebook rewrites it as a terminal does."""

    def write(text: str) -> None:
        if not quiet:
            print(text, end="", flush=True)

    live = sys.stdout.isatty() or type(sys.stdout).__module__.startswith("ipykernel")
    return Progress(write, live, shutil.get_terminal_size().columns)


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


def _locked(output: str | None) -> RunFolder:
    folder = RunFolder(Path(output) if output else new_name(Path(RUNS), "-merged"))
    try:
        folder.lock()
        for name in (RECORDS, TASKS):
            folder.inside(name)
    except FolderError as error:
        folder.release()
        raise BadInput(f"--output: {error}") from None
    if folder.holds_run:
        folder.release()
        raise BadInput(f"{folder.path} already holds a run; give another --output")
    return folder


BESIDE = ("traces/{}.npz", "pictures/{}.npz", "videos/{}.mp4")
"""What else a run folder may hold of a repetition, named as its log is."""


def _copy(records: list[Merged], folders: Folders, to: RunFolder) -> list[str]:
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
