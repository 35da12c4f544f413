"""`--sim-merge RUN...`: join runs with different seeds into one run folder, and exit.

The runs may come from anybody: of their folders only the records and the files beside them that
records name are read, nothing outside, and every file written has a name of ours.
"""

from __future__ import annotations

import os
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from pytest_simbench.plugin import options
from pytest_simbench.records.folder import Claim, FolderError, holds_run, inside, new_name
from pytest_simbench.records.joining import Joined, JoinError, join
from pytest_simbench.records.record import Record, RecordError
from pytest_simbench.records.record_file import RECORDS_NAME, RecordFile, read_records


def merge_runs(config: pytest.Config) -> int:
    """Join the runs, print the result, and return the exit code.

    Raises:
        pytest.UsageError: a run that cannot be read, runs that are not parts of one, or a folder
            that already holds a run or cannot be written to.
    """
    runs: dict[str, list[Record]] = {}
    folders: dict[str, Path] = {}
    files: set[Path] = set()
    problems: list[str] = []
    for name in config.getoption("sim_merge"):
        path = Path(config.invocation_params.dir, name)
        file = (path / RECORDS_NAME if path.is_dir() else path).resolve()
        if file in files:
            raise pytest.UsageError(f"--sim-merge {name}: the run is given twice")
        try:
            reading = read_records(path)
        except RecordError as error:
            raise pytest.UsageError(f"--sim-merge {name}: {error}") from None
        runs[name] = list(reading.records)
        problems += reading.problems
        files.add(file)
        folders[name] = path if path.is_dir() else path.parent
    try:
        joined = join(runs)
    except JoinError as error:
        raise pytest.UsageError(f"--sim-merge: {error}") from None
    if not joined:
        raise pytest.UsageError("--sim-merge: none of the runs holds a repetition that ended")
    claim = _claim(config)
    try:
        records, copied = _copy(joined, folders, claim.folder)
        problems += copied + _write(records, claim.folder)
        print(_report(claim.folder, records, problems))
    finally:
        claim.close()
    return 0


def _claim(config: pytest.Config) -> Claim:
    given = options.value(config, "sim_output")
    folder = (
        Path(config.invocation_params.dir, given)
        if given
        else new_name(config.rootpath / ".simbench", "-merged")
    )
    try:
        claim = Claim(folder)
        inside(folder, RECORDS_NAME)
    except FolderError as error:
        raise pytest.UsageError(f"--sim-merge: {error}") from None
    if holds_run(folder):
        claim.close()
        raise pytest.UsageError(
            f"--sim-merge: {folder} already holds a run; give another --sim-output"
        )
    return claim


def _copy(
    joined: list[Joined], folders: dict[str, Path], to: Path
) -> tuple[list[Record], list[str]]:
    """Logs and traces under the names that they have in the whole.

    Returns:
        The records, which name the copies; and what was refused, one sentence each.
    """
    from pytest_simbench.experiment.identity import file_stem_of

    records, refused = [], []
    for item in joined:
        stem, folder = file_stem_of(item.record), folders[item.run]
        details = dict(item.record.details)
        if log := item.was.details.get("log") or "":
            details["log"] = ""
        for source, target in (
            (log, f"logs/{stem}.log"),
            (f"traces/{file_stem_of(item.was)}.npz", f"traces/{stem}.npz"),
        ):
            try:
                if source and _copied(inside(folder, source), to, target) and source == log:
                    details["log"] = target
            except FolderError as error:
                refused.append(f"not copied: {error}")
        records.append(replace(item.record, details=details))
    return records, list(dict.fromkeys(refused))


def _copied(source: Path, folder: Path, target: str) -> bool:
    """Copy an ordinary file; a log that is missing makes no result wrong.

    Raises:
        FolderError: the target would lie outside of the folder.
    """
    path = inside(folder, target)
    try:
        if not source.is_file():
            return False
        path.parent.mkdir(parents=True, exist_ok=True)
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
        with source.open("rb") as old, open(os.open(path, flags, 0o666), "wb") as new:
            shutil.copyfileobj(old, new)
    except OSError:
        return False
    return True


def _write(records: list[Record], folder: Path) -> list[str]:
    """The records; what could not be written, one sentence each."""
    file = RecordFile(folder / RECORDS_NAME)
    for record in records:
        file.append(record)
    report = file.close()
    return [*report.problems, *report.unsaved]


def _report(folder: Path, records: list[Record], problems: list[str]) -> str:
    from pytest_simbench.report.files import write_report
    from pytest_simbench.report.matrix import with_wins
    from pytest_simbench.report.summary import summarise
    from pytest_simbench.report.tables import render_run
    from pytest_simbench.tasks import Stacking, Throwing

    tasks = (Stacking(), Throwing())
    metrics = {task.name: task.metrics for task in tasks}
    references = {task.name: task.references for task in tasks}
    summaries = with_wins(summarise(records, metrics, references), records)
    written = write_report(folder, summaries, records)
    shown = folder if written.complete else None
    text = render_run(summaries, shutil.get_terminal_size().columns, shown)
    return "\n".join([text, *problems, *written.problems])
