"""Results on repeatability as JSON lines in the run folder, one for each, flushed as it is made."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

NAME = "repeatability.jsonl"
SCHEMA = 1


@dataclass(frozen=True)
class Line:
    """One result.

    Attributes:
        kind: `replay`, `search`, `stability` or `sensitivity`.
        test: id of the test.
        simulator, mode, profile: what it is of.
        task, seed: what was run.
        settings, versions: of the simulator, and the task's parameters as `task.NAME`.
        result: by kind, see `replay`, `search` and `stability`.
    """

    kind: str
    test: str
    simulator: str
    mode: str
    profile: str
    task: str
    seed: int
    settings: Mapping[str, Any]
    versions: Mapping[str, str]
    result: Mapping[str, Any]

    @property
    def label(self) -> str:
        """Simulator, mode and profile, as tables name them."""
        return f"{self.simulator} {self.mode} {self.profile}"


def append(folder: Path, line: Line) -> None:
    """Write one line to the run folder, whole or not at all, beside other processes' lines.

    Raises:
        OSError: the folder cannot be written to.
    """
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps({"schema": SCHEMA, **vars(line)}) + "\n"
    descriptor = os.open(
        folder / NAME, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o666
    )
    try:
        os.write(descriptor, text.encode("ascii"))
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def read(folder: Path) -> list[Line]:
    """The lines of a run, in the order of their tests' ids; none when there is no file.

    Raises:
        ValueError: a line that is none of ours; names file and line.
    """
    path = folder / NAME
    if not path.is_file():
        return []
    lines = []
    for number, text in enumerate(path.read_text("ascii").splitlines(), start=1):
        try:
            data = json.loads(text)
            schema = data.pop("schema")
            line = Line(**data)
        except (ValueError, KeyError, TypeError, AttributeError):
            raise ValueError(f"{path}, line {number}: not a result on repeatability") from None
        if schema != SCHEMA:
            raise ValueError(f"{path}, line {number}: schema {schema}, this reads {SCHEMA}")
        lines.append(line)
    return sorted(lines, key=lambda line: (line.kind, line.task, line.test))
