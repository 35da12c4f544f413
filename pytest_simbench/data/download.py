"""Brings a data set from its public source, checks it, and keeps it in the form that is read."""

from __future__ import annotations

import gzip
import hashlib
import tarfile
import urllib.error
import urllib.request
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import IO

from pytest_simbench.data.measured import DataError
from pytest_simbench.data.sets import DataSet

TIMEOUT = 60.0
"""Longest silence of the server [s]."""

LARGEST = 2**30
"""Of an archive, packed or not, with what is not wanted of it [bytes]."""


def digest(files: Mapping[str, bytes]) -> str:
    """SHA-256 of files by their paths: of each path, size and content, in the order of the paths.

    Not of the archive: GitHub packs it anew when it likes, and then it has other bytes.
    """
    content = hashlib.sha256()
    for path in sorted(files):
        content.update(f"{path}\0{len(files[path])}\0".encode())
        content.update(files[path])
    return content.hexdigest()


def download(wanted: DataSet, folder: Path, tell: Callable[[str], None] = print) -> None:
    """Bring a data set into a folder.

    Raises:
        DataError: the server does not answer, what it sends is not that set, or it cannot be kept.
    """
    tell(f"{wanted.name}: from github.com/{wanted.repository}, {wanted.licence}")
    try:
        with urllib.request.urlopen(wanted.url, timeout=TIMEOUT) as answer:
            files = _wanted(answer, wanted.files)
    except (OSError, EOFError, zlib.error, tarfile.TarError) as error:
        reason = getattr(error, "reason", None) or str(error) or type(error).__name__
        raise DataError(f"{wanted.name} cannot be downloaded from {wanted.url}: {reason}") from None
    found = digest(files)
    if found != wanted.sha256:
        raise DataError(
            f"what {wanted.url} sends is not {wanted.name}: the SHA-256 of its {len(files)} files "
            f"is {found}, not {wanted.sha256}"
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        wanted.convert(files, folder)
    except OSError as error:
        raise DataError(f"{wanted.name} cannot be kept in {folder}: {error.strerror}") from None
    tell(f"{wanted.name}: {len(files)} files, {sum(map(len, files.values())) / 1e6:.0f} MB, kept")


class Limited:
    """What a server sends, until it is more than `LARGEST`: names and headers count too, and what
    nobody wants."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self._taken = 0

    def read(self, size: int = -1) -> bytes:
        """The next bytes.

        Raises:
            DataError: these are too many.
        """
        data = self._file.read(size)
        self._taken += len(data)
        if self._taken > LARGEST:
            raise DataError("the archive is larger than any data set")
        return data


def _wanted(archive: IO[bytes], beginnings: tuple[str, ...]) -> dict[str, bytes]:
    """The regular files of an archive whose paths begin so, without the archive's own folder."""
    files: dict[str, bytes] = {}
    plain = Limited(gzip.GzipFile(fileobj=Limited(archive)))  # type: ignore[call-overload]
    with tarfile.open(fileobj=plain, mode="r|") as packed:  # type: ignore[call-overload]
        for member in packed:
            path = member.name.partition("/")[2]
            content = packed.extractfile(member) if path.startswith(beginnings) else None
            if content is None or not member.isreg():
                continue
            files[path] = content.read()
    return files
