"""`--sim-merge RUN...`: join runs with different seeds into one run folder, and exit."""

from __future__ import annotations

import shutil
from contextlib import suppress
from datetime import datetime
from pathlib import Path

import pytest

from pytest_simbench import options
from pytest_simbench.measure.joining import Joined, JoinError, file_of, join
from pytest_simbench.measure.record import Record, RecordError
from pytest_simbench.measure.records import RECORDS_NAME, RecordFile, read_records


def merge_runs(config: pytest.Config) -> int:
    """Join the runs, print the result, and return the exit code.

    Raises:
        pytest.UsageError: a run that cannot be read, runs that are not parts of one, or a folder
            that already holds a run.
    """
    runs: dict[str, list[Record]] = {}
    folders: dict[str, Path] = {}
    for name in config.getoption("sim_merge"):
        path = Path(config.invocation_params.dir, name)
        if name in runs:
            raise pytest.UsageError(f"--sim-merge {name}: the run is given twice")
        try:
            runs[name] = list(read_records(path).records)
        except RecordError as error:
            raise pytest.UsageError(f"--sim-merge {name}: {error}") from None
        folders[name] = path if path.is_dir() else path.parent
    try:
        joined = join(runs)
    except JoinError as error:
        raise pytest.UsageError(f"--sim-merge: {error}") from None
    if not joined:
        raise pytest.UsageError("--sim-merge: none of the runs holds a repetition that ended")
    folder = _folder(config)
    for problem in _write(folder, joined, folders):
        print(problem)
    print(_report(folder, [item.record for item in joined]))
    return 0


def _folder(config: pytest.Config) -> Path:
    given = options.value(config, "sim_output")
    stamp = datetime.now().strftime("%Y-%m-%d_%H-%M-%S")
    folder = (
        Path(config.invocation_params.dir, given)
        if given
        else config.rootpath / ".simbench" / f"{stamp}-merged"
    )
    if (folder / RECORDS_NAME).exists():
        raise pytest.UsageError(
            f"--sim-merge: {folder} already holds a run; give another --sim-output"
        )
    return folder


def _write(folder: Path, joined: list[Joined], folders: dict[str, Path]) -> list[str]:
    """Records, logs and traces; what could not be written, one sentence each."""
    file = RecordFile(folder / RECORDS_NAME)
    for item in joined:
        file.append(item.record)
        log = str(item.record.details.get("log") or "")
        trace = f"traces/{Path(log).stem}.npz" if log else ""
        for name in filter(None, (log, trace)):
            source = folders[item.run] / file_of(name, item.record.repetition, item.number)
            if source.is_file():
                with suppress(OSError):  # a log that is missing makes no result wrong
                    (folder / name).parent.mkdir(parents=True, exist_ok=True)
                    shutil.copyfile(source, folder / name)
    report = file.close()
    return [*report.problems, *report.unsaved]


def _report(folder: Path, records: list[Record]) -> str:
    from pytest_simbench.report.files import write_report
    from pytest_simbench.report.matrix import with_wins
    from pytest_simbench.report.summary import summarise
    from pytest_simbench.report.tables import render_run
    from pytest_simbench.tasks import Stacking, Throwing

    tasks = (Stacking(), Throwing())
    metrics = {task.name: task.metrics for task in tasks}
    references = {task.name: task.references for task in tasks}
    summaries = with_wins(summarise(records, metrics, references), records)
    with suppress(OSError):
        write_report(folder, summaries, records)
    return render_run(summaries, shutil.get_terminal_size().columns, folder)
