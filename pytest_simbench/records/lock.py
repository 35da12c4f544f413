"""The lock on a run folder: never two runs in one."""

from __future__ import annotations

import errno
import fcntl
import os
import tempfile
from contextlib import suppress
from pathlib import Path

from pytest_simbench.records.paths import FolderError

PROBE = 64 * 1024
"""Bytes that a folder must be able to take before a run begins: some twenty records."""


class FolderLock:
    """A folder that this process writes a run to; until `close` no other run may use it.

    It is a lock on the folder itself and ends with the process, however that ends. A file
    system without locks (some network drives) gives none, and two runs could meet there. A folder
    that is not there is made. Several processes of one run (xdist's workers) are `shared`.

    Raises:
        FolderError: it cannot be written to, another run is under way in it, or its path is no
            UTF-8, in which workers are told where they run.
    """

    def __init__(self, folder: Path, *, shared: bool = False) -> None:
        self.folder = folder
        self._lock: int | None = None
        try:
            str(folder.absolute()).encode()
        except UnicodeEncodeError:
            raise FolderError(
                f"the path of the run folder {str(folder.absolute())!r} is no UTF-8, and workers "
                "cannot run there; give another folder"
            ) from None
        self._made = [path for path in (folder, *folder.parents) if not os.path.lexists(path)]
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        except OSError as error:
            raise FolderError(
                f"the run folder {folder} cannot be made ({_reason(folder, error)}); give another "
                "folder"
            ) from None
        try:
            self._take(shared)
            if not shared:
                _probe(folder)
        except FolderError:
            self.close()
            raise

    def _take(self, shared: bool) -> None:
        assert self._lock is not None
        kind = fcntl.LOCK_SH if shared else fcntl.LOCK_EX
        try:
            fcntl.flock(self._lock, kind | fcntl.LOCK_NB)
        except BlockingIOError:
            if not shared:  # else it is the controller of this run that holds it
                raise FolderError(
                    f"another run is under way in {self.folder}; wait for it, or give another "
                    "folder"
                ) from None
        except OSError as error:
            if error.errno not in (errno.ENOTSUP, errno.ENOLCK, errno.EBADF, errno.EINVAL):
                raise FolderError(
                    f"the run folder {self.folder} cannot be locked ({error.strerror})"
                ) from None

    def close(self) -> None:
        """Give it up; a folder made for nothing goes away."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None
            with suppress(OSError):
                for path in self._made:
                    path.rmdir()


def _probe(folder: Path) -> None:
    """Write some bytes, for space and permission."""
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(bytes(PROBE))
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        raise FolderError(
            f"the run folder {folder} cannot be written to ({error.strerror}); give another folder"
        ) from None


def _reason(folder: Path, error: OSError) -> str:
    """What is in the way, by name."""
    for path in (folder, *folder.parents):
        if os.path.islink(path) and not os.path.exists(path):
            return f"{path} is a link to nothing"
        if os.path.exists(path):
            return error.strerror or str(error) if path.is_dir() else f"{path} is a file"
    return error.strerror or str(error)
