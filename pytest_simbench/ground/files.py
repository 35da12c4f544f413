"""Files that somebody else may have made: read whole or not at all, never more than expected.

Used in workers too: standard library and numpy only.
"""

from __future__ import annotations

import io
import json
import math
import os
import stat
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


class FileError(ValueError):
    """A file that cannot be taken; the message names it and says why, in printable characters: a
    stranger may have chosen the path."""

    def __init__(self, message: str) -> None:
        super().__init__("".join(c if c.isprintable() else repr(c)[1:-1] for c in message))


def read_file(path: str | Path, largest: int, what: str = "the file") -> bytes:
    """The content of a regular file: no device, and no pipe, which might never end.

    Args:
        path: of the file.
        largest: size [bytes].
        what: the file is, for messages.

    Raises:
        FileError: there is none, it is no regular file, it is too large, or may not be read.
    """
    try:
        _check(os.stat(path), path, largest, what)  # before it is opened: a device may act on that
        with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb") as file:
            _check(os.fstat(file.fileno()), path, largest, what)
            data = file.read(largest + 1)
    except (OSError, ValueError) as error:
        if isinstance(error, FileError):
            raise
        reason = getattr(error, "strerror", None) or str(error)  # ValueError: a NUL in the name
        raise FileError(f"cannot read {what} {path}: {reason}") from None
    if len(data) > largest:
        raise FileError(_too_large(path, largest, what))
    return data


def _check(status: os.stat_result, path: str | Path, largest: int, what: str) -> None:
    kind = stat.S_IFMT(status.st_mode)
    if kind != stat.S_IFREG:
        raise FileError(f"cannot read {what} {path}: it is {KINDS.get(kind, 'no file')}")
    if status.st_size > largest:
        raise FileError(_too_large(path, largest, what))


def _too_large(path: str | Path, largest: int, what: str) -> str:
    return f"cannot read {what} {path}: it is larger than {largest / 2**20:g} MB"


def read_arrays(path: str | Path, largest: int) -> dict[str, np.ndarray]:
    """The arrays in a .npz file, of `largest` bytes together; never objects, which are code.

    Raises:
        FileError: no such file, too large, also when unpacked, or something else in it.
    """
    data = io.BytesIO(read_file(path, largest))
    try:
        with zipfile.ZipFile(data) as archive:
            if sum(item.file_size for item in archive.infolist()) > largest:
                raise FileError(_too_large(path, largest, "the arrays in"))
        with np.load(data, allow_pickle=False) as arrays:
            found = {name: arrays[name] for name in arrays.files}
    except FileError:
        raise
    except Exception as error:  # zipfile, zlib and numpy have many for what is none
        raise FileError(f"{path} holds no arrays: {error}") from None
    if not all(isinstance(array, np.ndarray) for array in found.values()):
        raise FileError(f"{path} holds something else than arrays")
    return found


def read_json(text: str | bytes) -> Any:
    """What strict JSON holds: every number is finite, and nothing is nested for ever.

    Raises:
        ValueError: it is none; the message says why.
    """
    try:
        return json.loads(text, parse_float=_finite, parse_constant=_finite)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text} is no finite number")
    return number
