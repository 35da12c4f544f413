"""Results on repeatability as JSON lines in the run folder, one for each, flushed as it is made."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pytest_simbench.records import checked, lines
from pytest_simbench.records.lines import Found, LinesFile, Unwritten

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


def append(folder: Path, line: Line) -> Unwritten:
    """Write one line to the run folder, else elsewhere; what it returns says where. Never raises
    OSError."""
    file = LinesFile(folder, NAME, noun="repeatability result")
    file.append(json.dumps({"schema": SCHEMA, **vars(line)}))
    return file.close()


def read(folder: Path) -> Found[Line]:
    """The lines of a run, in the order of their tests' ids; none when there is no file.

    Raises:
        UnreadableError: there is one, and it cannot be read.
    """
    if not os.path.lexists(folder / NAME):
        return Found()
    found = lines.read(folder, NAME, _line)
    items = sorted(found.items, key=lambda line: (line.kind, line.task, line.test))
    return replace(found, items=tuple(items))


def _line(data: dict[str, Any], where: str) -> Line:
    """The result in an object.

    Raises:
        ValueError: it is none of ours.
    """
    schema = data.pop("schema", None)
    try:
        line = Line(**checked.plain(data))
        fine = _is_line(line)
    except (ValueError, KeyError, TypeError, AttributeError):
        fine = False
    if not fine:
        raise ValueError(f"{where}: not a result on repeatability")
    if schema != SCHEMA:
        raise ValueError(f"{where}: schema {checked.short(schema)}, this reads {SCHEMA}")
    return line


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
