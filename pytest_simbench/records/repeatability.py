"""Results on repeatability as JSON lines in the run folder, one for each, flushed as it is made."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypedDict

import msgspec

from pytest_simbench.records import checked, lines
from pytest_simbench.records.lines import Found, LinesFile, Unwritten

NAME = "repeatability.jsonl"
SCHEMA = 1

Kind = Literal["replay", "search", "stability", "sensitivity"]
Seconds = Annotated[str, msgspec.Meta(pattern=r"^\d+(\.\d+)?$")]
"""A time as a key."""


class Way(TypedDict):
    """One way of running again, see `repeatability.replay_result.Again`."""

    way: str
    first: float | None
    body: str | None
    growth: dict[Seconds, float | None] | None
    largest: float | None
    changed: list[str]
    left_at: float | None
    skipped: str
    failure: str


class Replayed(TypedDict):
    """Result of a replay."""

    claims: bool
    again: list[Way]


class Told(TypedDict):
    """Result of any other kind."""

    sentence: str


@dataclass(frozen=True)
class Line:
    """One result.

    Attributes:
        test: id of the test.
        simulator, mode, profile: what it is of.
        task, seed: what was run.
        settings, versions: of the simulator, and the task's parameters as `task.NAME`.
        result: `Replayed` or `Told`, with more, see `replay`, `search` and `stability`.
    """

    kind: Kind
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
        line = checked.convert(checked.plain(data), Line)
        if line.kind == "replay":
            for way in checked.convert(line.result, Replayed)["again"]:
                parted = [way[key] for key in ("first", "body", "growth", "largest")]
                if None in parted and any(part is not None for part in parted):
                    raise checked.CheckError(f"{way['way']!r} parted in part")
        else:
            checked.convert(line.result, Told)
    except checked.CheckError:
        raise ValueError(f"{where}: not a result on repeatability") from None
    if schema != SCHEMA:
        raise ValueError(f"{where}: schema {checked.short(schema)}, this reads {SCHEMA}")
    return line
