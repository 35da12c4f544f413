"""Recordings of a run's repetitions in its folder: a bag for each trace, see `recordings.bag`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pytest_simbench.experiment.identity import file_stem_of
from pytest_simbench.recordings import trace as traces
from pytest_simbench.recordings.bag import write_bag
from pytest_simbench.recordings.trace import Trace, TraceError
from pytest_simbench.records.paths import FolderError, inside
from pytest_simbench.records.record import Record

FOLDER = "recordings"
"""In the run folder."""


def trace_of(run: Path, record: Record) -> Path | None:
    """The file of a repetition's trace, if the run folder has it.

    Raises:
        FolderError: it leads out of the folder.
    """
    path = inside(run, f"{traces.FOLDER}/{file_stem_of(record)}.npz")
    return path if path.is_file() else None


def write_bags(run: Path, target: Path, records: Sequence[Record]) -> tuple[int, list[str]]:
    """Write a bag for each repetition that has a trace; those that are up to date stay.

    Args:
        run: folder of the run.
        target: folder in which `recordings/` is.
        records: of the run.

    Returns:
        How many there are now; and what could not be written, one sentence each.
    """
    count, problems = 0, []
    for record in records:
        try:
            path = trace_of(run, record)
            if path is None:
                continue
            folder = inside(target, f"{FOLDER}/{path.stem}")
            if not _up_to_date(folder, path):
                folder.parent.mkdir(parents=True, exist_ok=True)
                write_bag(Trace.read(path), folder, _told(record))
            count += 1
        except (FolderError, TraceError) as error:
            problems.append(f"no recording: {error}")
        except OSError as error:
            problems.append(f"no recording in {target / FOLDER}: {error.strerror or error}")
    return count, list(dict.fromkeys(problems))


def _up_to_date(folder: Path, trace: Path) -> bool:
    metadata = folder / "metadata.yaml"  # written last
    return metadata.is_file() and metadata.stat().st_mtime >= trace.stat().st_mtime


def _told(record: Record) -> dict[str, str]:
    """What the bag's metadata says of the repetition."""
    return {
        "test": record.test,
        "simulator": record.simulator,
        "mode": record.mode,
        "profile": record.profile,
        "task": record.task,
        "seed": str(record.seed),
        "repetition": str(record.repetition),
        "status": record.status,
        "versions": ", ".join(f"{name} {version}" for name, version in record.versions.items()),
    }
