"""Results on repeatability as JSON lines in the run folder, one for each, flushed as it is made."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pytest_simbench.simulator.files import read_file, read_json

NAME = "repeatability.jsonl"
SCHEMA = 1

LARGEST = 256 * 2**20
"""Of the file [bytes]; a line has about 1 kB."""


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
    for number, text in enumerate(read_file(path, LARGEST).splitlines(), start=1):
        try:
            data = read_json(text)
            schema = data.pop("schema")
            line = Line(**data)
            fine = _is_line(line)
        except (ValueError, KeyError, TypeError, AttributeError):
            fine = False
        if not fine:
            raise ValueError(f"{path}, line {number}: not a result on repeatability")
        if schema != SCHEMA:
            raise ValueError(f"{path}, line {number}: schema {schema!r:.20}, this reads {SCHEMA}")
        lines.append(line)
    return sorted(lines, key=lambda line: (line.kind, line.task, line.test))


def _is_line(line: Line) -> bool:
    """Whether its parts are what the tables read.

    Raises:
        KeyError, TypeError, AttributeError: they are not.
    """
    texts = (line.test, line.simulator, line.mode, line.profile, line.task)
    if not (all(isinstance(text, str) for text in texts) and isinstance(line.seed, int)):
        return False
    if line.kind != "replay":
        sentence = line.result["sentence"]
        return line.kind in ("search", "stability", "sensitivity") and isinstance(sentence, str)
    return isinstance(line.result["claims"], bool) and all(
        _is_again(again) for again in line.result["again"]
    )


def _is_again(data: Mapping[str, Any]) -> bool:
    if not isinstance(data["changed"], list):
        return False
    texts = [data["way"], data["skipped"], data["failure"], *data["changed"]]
    if data["first"] is not None:
        texts.append(data["body"])
        numbers = [data["first"], data["largest"], *data["growth"].values()]
        if not all(isinstance(number, int | float | None) for number in numbers):
            return False
        [float(time) for time in data["growth"]]
        if None in numbers[:2]:
            return False
    return all(isinstance(text, str) for text in texts) and isinstance(
        data["left_at"], int | float | None
    )
