"""Paths of a run folder: nothing leads out of it, and no file of it is ever half written."""

from __future__ import annotations

import os
import secrets
from contextlib import suppress
from datetime import datetime
from pathlib import Path


class FolderError(ValueError):
    """A folder that cannot be used; the message is a whole sentence."""


def new_name(parent: Path, ending: str = "") -> Path:
    """A folder of this moment which no other run has: `2026-07-01_12-00-00-1f3a9c7e`."""
    stamp = datetime.now().strftime("%Y-%m-%d_%H-%M-%S")
    return parent / f"{stamp}-{secrets.token_hex(4)}{ending}"


def inside(folder: Path, name: str) -> Path:
    """The path of a file named in a folder, when it lies in it, also after following links.

    Raises:
        FolderError: it leads out of the folder.
    """
    try:
        root = folder.resolve()
        path = (root / name).resolve()
    except (OSError, ValueError, RuntimeError):  # a NUL byte, a link to itself
        raise FolderError(f"{name!r} of the run {folder} is no file's name") from None
    if path == root or root not in path.parents:
        raise FolderError(f"{name!r} of the run {folder} leads out of its folder")
    return root / name


def write_whole(path: Path, content: bytes) -> None:
    """Write a file, or leave what was there: never half of it. A link of that name is replaced.

    Raises:
        OSError: it cannot be written.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        part.write_bytes(content)
        part.replace(path)
    except OSError:
        with suppress(OSError):
            part.unlink()
        raise
