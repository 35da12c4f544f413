"""The file of a run's records: appended to by several processes, flushed, never lost."""

from __future__ import annotations

import errno
import os
import re
import tempfile
from dataclasses import dataclass
from pathlib import Path

from pytest_simbench.measure.record import Failure, Record, RecordError

__all__ = [
    "RECORDS_NAME",
    "CloseReport",
    "Failure",
    "Reading",
    "Record",
    "RecordError",
    "RecordFile",
    "read_records",
]

RECORDS_NAME = "records.jsonl"
"""Name of the record file in a run folder."""


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
        self._pending.append(record.to_json())
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
            descriptor = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o666)
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


@dataclass(frozen=True)
class Reading:
    """What a record file held.

    Attributes:
        records: in the order of the file.
        problems: lines that a crash or a full disk cut short, one sentence each.
    """

    records: tuple[Record, ...] = ()
    problems: tuple[str, ...] = ()


def read_records(path: Path | str) -> Reading:
    """The records in a file, or in `records.jsonl` of a run folder.

    A line that was cut short (by a crash, or a full disk) is a problem and is left out. A line that
    is there twice counts once: it was written again because the disk did not confirm it. A
    repetition that was interrupted and then run again (`--sim-resume`) counts as the latter.

    Raises:
        RecordError: there is no such file, or a whole line is not a record.
    """
    path = Path(path)
    if path.is_dir():
        path = path / RECORDS_NAME
    try:
        content = path.read_bytes()
    except OSError as error:
        raise RecordError(
            f"cannot read records from {path} ({error.strerror}); give a run folder "
            f"or its {RECORDS_NAME}"
        ) from None
    records: list[Record] = []
    problems: list[str] = []
    seen: set[bytes] = set()
    for number, line in enumerate(content.split(b"\n"), start=1):
        if not line.strip() or line in seen:
            continue
        seen.add(line)
        where = f"{path}:{number}"
        if _cut_short(line):
            problems.append(f"{where}: the line was cut short and is left out")
        else:
            records.append(Record.from_json(line, where))
    return Reading(_settled(records), tuple(problems))


def _settled(records: list[Record]) -> tuple[Record, ...]:
    """The records without interrupted repetitions that came to an end later."""
    ended = {(r.test, r.repetition, r.seed) for r in records if r.status != "interrupted"}
    return tuple(
        r
        for r in records
        if r.status != "interrupted" or (r.test, r.repetition, r.seed) not in ended
    )


_STRING = re.compile(rb'"(?:\\.|[^"\\])*"')


def _cut_short(line: bytes) -> bool:
    """Whether a line is the start of a JSON object that does not end."""
    bare = _STRING.sub(b"", line)
    return line.startswith(b"{") and (b'"' in bare or bare.count(b"{") > bare.count(b"}"))
