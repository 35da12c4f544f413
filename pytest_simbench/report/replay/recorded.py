"""What a run's folder holds of its repetitions: traces, which a replay shows side by side, videos,
and a bag for each trace."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from pytest_simbench.experiment.identity import file_stem_of
from pytest_simbench.recordings import film
from pytest_simbench.recordings import trace as traces
from pytest_simbench.recordings.bag import write_bag
from pytest_simbench.recordings.trace import Trace, TraceError
from pytest_simbench.records.configuration import task_parameters
from pytest_simbench.records.paths import FolderError, inside
from pytest_simbench.records.record import Record
from pytest_simbench.report.replay import REPLAY_NAME
from pytest_simbench.report.terminal.progress import Progress

FOLDER = "recordings"
"""In the run folder."""

TOLD = ("test", "simulator", "mode", "profile", "task", "seed", "repetition", "status")
"""Of the record's fields those that are in a bag's metadata."""


def trace_of(run: Path, record: Record) -> Path | None:
    """The file of a repetition's trace, if the run folder has it.

    Raises:
        FolderError: it leads out of the folder.
    """
    path = inside(run, f"{traces.FOLDER}/{file_stem_of(record)}.npz")
    return path if path.is_file() else None


@dataclass
class Group:
    """Repetitions of one task with one seed, each with its trace."""

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


def videos(run: Path) -> Callable[[Record], str]:
    """Gives the address of a repetition's video in the run folder; empty where there is none."""
    try:
        there = {path.name for path in inside(run, film.FOLDER).iterdir()}
    except (OSError, FolderError):
        there = set()

    def address(record: Record) -> str:
        if not there or (name := f"{file_stem_of(record)}.mp4") not in there:
            return ""
        found = f"{film.FOLDER}/{name}"
        try:
            return found if inside(run, found).is_file() else ""
        except FolderError:
            return ""

    return address


def write_bags(
    run: Path, target: Path, records: Sequence[Record], progress: Progress
) -> tuple[int, list[str]]:
    """Write a bag into `recordings/` of the target for each repetition of a run that has a trace,
    which takes some seconds each; those that are up to date stay.

    Returns:
        How many there are now; and what could not be written, one sentence each.
    """
    count, problems = 0, []
    waiting: list[tuple[Record, Path, Path]] = []
    for record in records:
        try:
            path = trace_of(run, record)
            if path is not None:
                folder = inside(target, f"{FOLDER}/{path.stem}")
                written = _up_to_date(folder, path)
                count += written
                waiting += [(record, path, folder)] * (not written)
        except FolderError as error:
            problems.append(f"no recording: {error}")
    progress.start_test(FOLDER, len(waiting))
    for number, (record, path, folder) in enumerate(waiting, start=1):
        progress.repetition(number, record.seed)
        began, status = time.monotonic(), "failed"
        try:
            folder.parent.mkdir(parents=True, exist_ok=True)
            write_bag(Trace.read(path), folder, _told(record))
            count, status = count + 1, "ok"
        except TraceError as error:
            problems.append(f"no recording: {error}")
        except OSError as error:
            problems.append(f"no recording in {target / FOLDER}: {error.strerror or error}")
        progress.end_repetition(status, time.monotonic() - began)
    progress.end_test()
    return count, list(dict.fromkeys(problems))


def _up_to_date(folder: Path, trace: Path) -> bool:
    metadata = folder / "metadata.yaml"  # written last
    return metadata.is_file() and metadata.stat().st_mtime >= trace.stat().st_mtime


def _told(record: Record) -> dict[str, str]:
    """What the bag's metadata says of the repetition."""
    versions = ", ".join(f"{name} {version}" for name, version in record.versions.items())
    return {**{name: str(getattr(record, name)) for name in TOLD}, "versions": versions}
