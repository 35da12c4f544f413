"""JSON-lines files of a run folder: appended to by several processes, flushed, never lost.

One writer and one reader for all of them. A line is a JSON object. What a crash, a full disk or a
power loss does to a line takes no other line with it.
"""

from __future__ import annotations

import errno
import gc
import json
import os
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Generic, TypeVar

from pytest_simbench.records.paths import opened, whole

T = TypeVar("T")

LARGEST_LINE = 16 * 1024 * 1024
"""Bytes; a record has a few thousand, with a trace of every cube's poses some hundred thousand."""

MUCH = 16 * 1024 * 1024
"""Bytes of a file, some ten thousand records: from there on the garbage collector is spared."""

DAMAGED = "the line is damaged and left out: "


class UnreadableError(ValueError):
    """A file that cannot be read; the message is a whole sentence.

    Attributes:
        reason: why, in a few words.
    """

    def __init__(self, path: Path, reason: str) -> None:
        super().__init__(f"{path} cannot be read ({reason})")
        self.reason = reason


@dataclass(frozen=True)
class Unwritten:
    """What became of lines that could not be written; empty and false when all were.

    Attributes:
        problems: one sentence each, for the terminal.
        fallback: the file that holds what the run folder could not take, or None.
        unsaved: the lines that no file holds: print them.
    """

    problems: tuple[str, ...] = ()
    fallback: Path | None = None
    unsaved: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.problems)


def spare_folder() -> Path:
    """A name for a folder in the system's temporary folder, for what a run folder cannot take."""
    return Path(tempfile.gettempdir(), f"simbench-{os.getpid()}-{os.urandom(3).hex()}")


class LinesFile:
    """Appends lines to a file as they are made, each with one write call and an fsync.

    Several processes may append to one file (O_APPEND: the kernel places each write at the end).
    It is opened anew for each line, so that a fork or a long run holds no descriptor. Where
    writing fails (disk full, folder gone) the line is kept in memory and tried again with the
    next one and when closing; then it goes to a file of the same name in `fallback`, else it is
    handed back.

    Args:
        folder: of the file; it is made when the first line comes.
        name: of the file.
        fallback: folder for what `folder` cannot take; default: `spare_folder()`.
        noun: what a line is, for messages.
    """

    def __init__(
        self, folder: Path, name: str, fallback: Path | None = None, noun: str = "line"
    ) -> None:
        self.path = folder / name
        self._name = name
        self._fallback = fallback
        self._noun = noun
        self._pending: list[str] = []
        self._reason: OSError | None = None

    def append(self, line: str) -> bool:
        """Write a line of ASCII; False when it has to wait in memory. Never raises OSError."""
        self._pending.append(line)
        return self._flush(self.path.parent)

    def close(self) -> Unwritten:
        """Try once more to write what waits, then elsewhere; may be called again."""
        if not self._pending or self._flush(self.path.parent):
            return Unwritten()
        count = f"{len(self._pending)} {self._noun}{'s' if len(self._pending) > 1 else ''}"
        lost = f"{count} could not be written to {self.path} ({self._why()})"
        folder = self._fallback or spare_folder()
        fallback = folder / self._name
        if self._flush(folder):
            return Unwritten((f"{lost}; they are in {fallback}",), fallback)
        unsaved, self._pending = tuple(self._pending), []
        problem = f"{lost} nor to {folder} ({self._why()}); they follow, one a line: save them"
        return Unwritten((problem,), None, unsaved)

    def _why(self) -> str:
        return str((self._reason and self._reason.strerror) or self._reason)

    def _flush(self, folder: Path) -> bool:
        """Write what waits into a folder; a line leaves the memory once it is on the disk."""
        try:
            is_new = not os.path.exists(folder / self._name)
            descriptor = opened(folder, self._name, os.O_RDWR | os.O_APPEND | os.O_CREAT)
            if is_new:
                _sync_folder(folder)
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


@dataclass(frozen=True)
class Found(Generic[T]):
    """What a file held.

    Attributes:
        items: in the order of the file.
        problems: damaged lines (a crash, a full disk, a power loss), one sentence each; they are
            left out.
        refused: whole lines that are none of ours, one sentence each.
    """

    items: tuple[T, ...] = ()
    problems: tuple[str, ...] = ()
    refused: tuple[str, ...] = ()


def read(folder: Path, name: str, make: Callable[[dict[str, Any], str], T]) -> Found[T]:
    """The lines of an ordinary file in a folder. `make` turns an object and its place, for
    messages, into an item, or raises ValueError.

    Raises:
        UnreadableError: there is no such file.
    """
    items: list[T] = []
    problems: list[str] = []
    refused: list[str] = []
    with _kept_for_good(folder / name):
        for line in _lines(folder, name):
            if line.problem:
                problems.append(f"{line.where}: {DAMAGED}{line.problem}")
            for data in line.found:
                try:
                    items.append(make(data, line.where))
                except ValueError as error:
                    refused.append(str(error))
    return Found(tuple(items), tuple(problems), tuple(refused))


@contextmanager
def _kept_for_good(path: Path) -> Iterator[None]:
    """Have Python's cyclic garbage collector leave alone what is made in this block, if it is much.

    Records hold no cycles. To look through 100,000 of them again and again takes longer than to
    read them, and later more than half of the gate's time. They are freed as ever once nobody holds
    them.
    """
    try:
        much = gc.isenabled() and path.stat().st_size >= MUCH
    except OSError:
        much = False
    if not much:
        yield
        return
    gc.collect()  # what is garbage already would stay
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


def repair(folder: Path, name: str) -> Path | None:
    """Write a file anew without its damaged lines; the old one stays beside it.

    Returns:
        The copy of the damaged file; None when nothing is damaged.

    Raises:
        UnreadableError: there is no such file.
        OSError: the folder cannot be written to.
    """
    lines = list(_lines(folder, name))
    if not any(line.problem for line in lines):
        return None
    number = 1
    while os.path.lexists(folder / (kept := f"{name}.damaged-{number}")):
        number += 1
    with whole(folder, kept) as copy, open(opened(folder, name), "rb") as damaged:
        shutil.copyfileobj(damaged, copy)
        _sync(copy)
    with whole(folder, name) as file:
        for line in lines:
            for data in line.found:
                file.write(json.dumps(data).encode("ascii") + b"\n")
        _sync(file)
    _sync_folder(folder)
    return folder / kept


def _sync(file: BinaryIO) -> None:
    file.flush()
    os.fsync(file.fileno())


@dataclass(frozen=True)
class _Line:
    """A line of a file: the JSON objects in it, and what is wrong with it if anything is."""

    where: str
    found: tuple[dict[str, Any], ...]
    problem: str


def _lines(folder: Path, name: str) -> Iterator[_Line]:
    """The lines that are not empty."""
    path = folder / name
    try:
        with open(opened(folder, name), "rb") as file:
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise UnreadableError(path, "it is no ordinary file")
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
        raise UnreadableError(path, error.strerror or str(error)) from None


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
            why = why or f"a line is a JSON object, not {type(data).__name__}"
    return _Line(where, tuple(found), why)


def _no_number(text: str) -> float:
    raise ValueError(f"{text} is no number in JSON")
