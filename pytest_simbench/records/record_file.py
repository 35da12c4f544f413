"""The file of a run's records: appended to by several processes, flushed, never lost."""

from __future__ import annotations

import errno
import json
import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from pytest_simbench.records.folder import FolderError, inside
from pytest_simbench.records.record import Failure, Record, RecordError
from pytest_simbench.records.series import settled

__all__ = [
    "RECORDS_NAME",
    "CloseReport",
    "Failure",
    "Reading",
    "Record",
    "RecordError",
    "RecordFile",
    "read_records",
    "repair",
    "scan",
]

RECORDS_NAME = "records.jsonl"
"""Name of the record file in a run folder."""

LARGEST_LINE = 16 * 1024 * 1024
"""Bytes; a record has a few thousand, with a trace of every cube's poses some hundred thousand."""


@dataclass(frozen=True)
class CloseReport:
    """What became of records that could not be written; empty and false when all were.

    Attributes:
        problems: one sentence each, for the terminal.
        fallback: the file that holds what the run folder could not take, or None.
        unsaved: the JSON lines that no file holds: print them.
    """

    problems: tuple[str, ...] = ()
    fallback: Path | None = None
    unsaved: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.problems)


class RecordFile:
    """Appends records to a file as they are made, each with one write call and an fsync.

    Several processes may append to one file (O_APPEND: the kernel places each write at the end).
    It is opened anew for each record, so that a fork or a long run holds no descriptor. Where
    writing fails (disk full, folder gone) the record is kept in memory and tried again with the
    next one and when closing; then it goes to `fallback`, else it is handed back as a line.

    Args:
        path: the file; its folder is made when the first record comes.
        fallback: folder for what `path` cannot take; default: the system's temporary folder.
    """

    def __init__(self, path: Path | str, fallback: Path | str | None = None) -> None:
        self.path = Path(path)
        self._fallback = fallback
        self._pending: list[str] = []
        self._reason: OSError | None = None

    @property
    def pending(self) -> int:
        """How many records wait in memory because they could not be written."""
        return len(self._pending)

    def append(self, record: Record) -> bool:
        """Write a record; False when it has to wait in memory. Never raises OSError."""
        line = record.to_json()
        if len(line) >= LARGEST_LINE:  # no reader would take it
            kept = {key: record.details[key] for key in ("log",) if key in record.details}
            note = f"{len(line)} bytes, more than a record may have"
            line = replace(record, details={**kept, "left_out": note}).to_json()
        self._pending.append(line)
        return self._flush(self.path)

    def close(self) -> CloseReport:
        """Try once more to write what waits, then elsewhere; may be called again."""
        if not self._pending or self._flush(self.path):
            return CloseReport()
        count = f"{len(self._pending)} record{'s' if len(self._pending) > 1 else ''}"
        lost = f"{count} could not be written to {self.path} ({self._why()})"
        folder = Path(self._fallback or tempfile.gettempdir())
        fallback = folder / f"simbench-{os.getpid()}-{os.urandom(3).hex()}.jsonl"
        if self._flush(fallback):
            return CloseReport((f"{lost}; they are in {fallback}",), fallback)
        unsaved, self._pending = tuple(self._pending), []
        problem = f"{lost} nor to {folder} ({self._why()}); they follow, one a line: save them"
        return CloseReport((problem,), None, unsaved)

    def _why(self) -> str:
        return str((self._reason and self._reason.strerror) or self._reason)

    def _flush(self, path: Path) -> bool:
        """Write what waits to `path`; a record leaves the memory once it is on the disk."""
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            is_new = not path.exists()
            descriptor = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o666)
            if is_new:
                _sync_folder(path.parent)
            try:
                while self._pending:
                    _append_line(descriptor, self._pending[0])
                    del self._pending[0]
            finally:
                os.close(descriptor)
        except OSError as error:
            self._reason = error
            return False
        return True


def _append_line(descriptor: int, line: str) -> None:
    """One whole line in one write; an unfinished line before it (a crash, a full disk) is ended."""
    size = os.fstat(descriptor).st_size
    torn = size > 0 and os.pread(descriptor, 1, size - 1) != b"\n"
    data = (b"\n" if torn else b"") + line.encode("ascii") + b"\n"
    if os.write(descriptor, data) != len(data):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # not a file: a pipe, a device
            raise


def _sync_folder(folder: Path) -> None:
    """A new file's name reaches the disk too, where the file system knows of that."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


DAMAGED = "the line is damaged and left out: "


@dataclass(frozen=True)
class Reading:
    """What a record file held.

    Attributes:
        records: those that count, in the order of the file, see `series.settled`.
        problems: damaged lines (a crash, a full disk, a power loss), one sentence each; they are
            left out.
        refused: whole lines that are no records of ours, one sentence each.
        every: also what does not count: earlier attempts, interrupted repetitions run again.
    """

    records: tuple[Record, ...] = ()
    problems: tuple[str, ...] = ()
    refused: tuple[str, ...] = ()
    every: tuple[Record, ...] = ()


def read_records(path: Path | str) -> Reading:
    """The records in a file, or in `records.jsonl` of a run folder.

    Damaged lines are left out, each with a problem.

    Raises:
        RecordError: there is no such file, a whole line is not a record, or every line is damaged.
    """
    found = scan(path)
    if found.refused:
        raise RecordError(found.refused[0])
    if found.problems and not found.every:
        raise RecordError(found.problems[0].replace(DAMAGED, ""))
    return found


def scan(path: Path | str) -> Reading:
    """The same, with what is no record of ours told instead of raised.

    Raises:
        RecordError: there is no such file.
    """
    records: list[Record] = []
    problems: list[str] = []
    refused: list[str] = []
    for line in _lines(_file_of(Path(path))):
        if line.problem:
            problems.append(f"{line.where}: {DAMAGED}{line.problem}")
        for data in line.found:
            try:
                records.append(Record.from_dict(data, line.where))
            except RecordError as error:
                refused.append(str(error))
    return Reading(tuple(settled(records)), tuple(problems), tuple(refused), tuple(records))


def repair(path: Path | str) -> Path | None:
    """Write a record file anew without its damaged lines; the old one stays beside it.

    Returns:
        The copy of the damaged file; None when nothing is damaged.

    Raises:
        RecordError: there is no such file.
        OSError: the folder cannot be written to.
    """
    path = _file_of(Path(path))
    lines = list(_lines(path))
    if not any(line.problem for line in lines):
        return None
    number = 1
    while (kept := path.with_name(f"{path.name}.damaged-{number}")).exists():
        number += 1
    os.link(path, kept)
    fresh = path.with_name(f"{path.name}.{os.getpid()}.part")
    with fresh.open("wb") as file:
        for line in lines:
            for data in line.found:
                file.write(json.dumps(data).encode("ascii") + b"\n")
        file.flush()
        os.fsync(file.fileno())
    fresh.replace(path)
    _sync_folder(path.parent)
    return kept


def _file_of(path: Path) -> Path:
    """The record file that a path means: itself, or the one of a run folder."""
    try:
        if path.is_dir():
            path = inside(path, RECORDS_NAME)
        mode = path.stat().st_mode
        if not stat.S_ISREG(mode):
            raise RecordError(f"cannot read records from {path}: it is no ordinary file")
    except FolderError as error:
        raise RecordError(f"cannot read records: {error}") from None
    except OSError as error:
        raise RecordError(_unreadable(path, error)) from None
    return path


def _unreadable(path: Path, error: OSError) -> str:
    return (
        f"cannot read records from {path} ({error.strerror}); give a run folder "
        f"or its {RECORDS_NAME}"
    )


@dataclass(frozen=True)
class _Line:
    """A line of a record file: the JSON objects in it, and what is wrong with it if anything is."""

    where: str
    found: tuple[dict[str, object], ...] = ()
    problem: str = ""


def _lines(path: Path) -> Iterator[_Line]:
    """The lines that are not empty."""
    try:
        with path.open("rb") as file:
            number = 0
            while content := file.readline(LARGEST_LINE):
                number += 1
                where = f"{path}:{number}"
                if len(content) == LARGEST_LINE and not content.endswith(b"\n"):
                    while rest := file.readline(LARGEST_LINE):
                        if rest.endswith(b"\n"):
                            break
                    yield _Line(where, (), f"it has more than {LARGEST_LINE} bytes")
                elif content.strip():
                    yield _line(where, content)
    except OSError as error:
        raise RecordError(_unreadable(path, error)) from None


def _line(where: str, content: bytes) -> _Line:
    """What is whole in a line; a power loss leaves NUL bytes before or after it."""
    found = []
    why = "it holds NUL bytes" if b"\0" in content else ""
    for part in filter(bytes.strip, content.split(b"\0")):
        try:
            data = json.loads(part.decode("utf-8"), parse_constant=_no_number)
        except (ValueError, RecursionError) as error:
            reason = type(error).__name__ if isinstance(error, RecursionError) else str(error)
            why = why or f"not JSON ({reason[:80]})"
            continue
        if isinstance(data, dict):
            found.append(data)
        else:
            why = why or f"a record is a JSON object, not {type(data).__name__}"
    return _Line(where, tuple(found), why)


def _no_number(text: str) -> float:
    raise ValueError(f"{text} is no number in JSON")
