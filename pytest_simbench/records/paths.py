"""Files of a run folder: nothing leads out of it, and no file of it is ever half written.

The user names the folder. What lies in it may be anybody's: a link in it is never followed, neither
to read nor to write, and a temporary file has a name that nobody can guess.
"""

from __future__ import annotations

import errno
import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path, PurePath
from typing import BinaryIO

FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC
FILE = os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
"""A pipe must not block: whoever opens one is told that it is no file."""

NEW = os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC


REFUSED = {
    errno.ELOOP: "leads out of its folder or is a link",
    errno.EINVAL: "is no file's name",
    errno.ENAMETOOLONG: "is no file's name",
}
"""What is wrong with a name, by the error's number; other errors are the system's."""


class FolderError(ValueError):
    """A folder that cannot be used; the message is a whole sentence."""


def new_name(parent: Path, ending: str = "") -> Path:
    """A folder of this moment which no other run has: `2026-07-01_12-00-00-1f3a9c7e`."""
    stamp = datetime.now().strftime("%Y-%m-%d_%H-%M-%S")
    return parent / f"{stamp}-{secrets.token_hex(4)}{ending}"


def inside(folder: Path, name: str) -> Path:
    """The path of a file named in a folder, for what takes nothing but a path. Whether there is
    one is not told.

    Raises:
        FolderError: it leads out of the folder, or lies behind a link.
    """
    try:
        with _place(folder, name, make=False) as (at, last):
            if stat.S_ISLNK(os.stat(last, dir_fd=at, follow_symlinks=False).st_mode):
                raise _refused(errno.ELOOP, folder, name)
    except OSError as error:
        if error.errno in REFUSED:
            raise FolderError(f"{name!r} of the run {folder} {REFUSED[error.errno]}") from None
    return folder / name


def opened(folder: Path, name: str, flags: int = os.O_RDONLY) -> int:
    """A descriptor of a file in a folder; with `os.O_CREAT` missing folders are made too.

    Raises:
        OSError: it cannot be opened, leads out of the folder, or lies behind a link.
    """
    with _place(folder, name, make=bool(flags & os.O_CREAT)) as (at, last):
        try:
            return os.open(last, flags | FILE, 0o666, dir_fd=at)
        except OSError as error:
            raise _refused(error.errno or 0, folder, name) from None


@contextmanager
def whole(folder: Path, name: str) -> Iterator[BinaryIO]:
    """A file to write to. It has its name when the block has ended well, and leaves nothing
    otherwise; a link or a file of that name is replaced.

    Raises:
        OSError: it cannot be written, leads out of the folder, or lies behind a link.
    """
    with _place(folder, name, make=True) as (at, last):
        part = f".{secrets.token_hex(16)}.part"
        descriptor = os.open(part, NEW, 0o666, dir_fd=at)
        try:
            with open(descriptor, "w+b") as file:
                yield file
            os.replace(part, last, src_dir_fd=at, dst_dir_fd=at)
        except BaseException:
            with suppress(OSError):
                os.unlink(part, dir_fd=at)
            raise


def write_whole(folder: Path, name: str, content: bytes) -> None:
    """Write a file of a folder, or leave what was there, see `whole`.

    Raises:
        OSError: it cannot be written, leads out of the folder, or lies behind a link.
    """
    with whole(folder, name) as file:
        file.write(content)


@contextmanager
def _place(folder: Path, name: str, *, make: bool) -> Iterator[tuple[int, str]]:
    """A descriptor of the folder in which a file lies, and the file's own name.

    Each folder on the way is opened from the one above it: nobody can put a link in between.
    """
    parts = PurePath(name).parts
    if not parts or ".." in parts or os.path.isabs(name):
        raise _refused(errno.ELOOP, folder, name)
    try:
        if b"\0" in os.fsencode(name):
            raise _refused(errno.EINVAL, folder, name)
    except UnicodeEncodeError:
        raise _refused(errno.EINVAL, folder, name) from None
    if make:
        folder.mkdir(parents=True, exist_ok=True)
    at = os.open(folder, FOLDER)
    try:
        for part in parts[:-1]:
            if make:
                with suppress(FileExistsError):
                    os.mkdir(part, dir_fd=at)
            if stat.S_ISLNK(os.stat(part, dir_fd=at, follow_symlinks=False).st_mode):
                raise _refused(errno.ELOOP, folder, name)
            below = os.open(part, FOLDER | os.O_NOFOLLOW, dir_fd=at)
            os.close(at)
            at = below
        yield at, parts[-1]
    finally:
        os.close(at)


def _refused(number: int, folder: Path, name: str) -> OSError:
    return OSError(number, REFUSED.get(number) or os.strerror(number), str(folder / name))
