"""Results on repeatability as JSON lines in the run folder, one for each, flushed as it is made."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypedDict

import msgspec

from pytest_simbench.records import checked, lines
from pytest_simbench.records.configuration import TASK, text
from pytest_simbench.records.lines import Found, LinesFile, Unwritten
from pytest_simbench.records.metrics import significant

NAME = "repeatability.jsonl"
SCHEMA = 1

Kind = Literal["replay", "search", "stability", "sensitivity"]
Seconds = Annotated[str, msgspec.Meta(pattern=r"^\d+(\.\d+)?$")]
"""A time as a key."""


GROWTH_TIMES = ("1", "5", "20")
"""Growth of a difference is reported so long after it arose [s]."""


@dataclass(frozen=True, kw_only=True)
class StateDifference:
    """How two runs of the same commands part; nothing is set where every bit is the same.

    Attributes:
        first: simulated time of the first sample that is not the same, bit for bit [s].
        body: the cube that differs there, "" when it is the robot alone.
        growth: by seconds after that, the largest distance between a cube here and there [m];
            None where the episode was over.
        largest: of these distances at any time [m].

    Raises:
        ValueError: only some are set.
    """

    first: float | None = None
    body: str | None = None
    growth: Mapping[Seconds, float | None] | None = None
    largest: float | None = None

    def __post_init__(self) -> None:
        if len({part is None for part in (self.first, self.body, self.growth, self.largest)}) > 1:
            raise ValueError("it parted in part")


@dataclass(frozen=True, kw_only=True)
class Again(StateDifference):
    """One way of running again, and where it parted from the first run.

    Attributes:
        way: what was done in between, for tables.
        changed: counts of the task's outcome that are not the same.
        left_at: when the task no longer asked for what the tape has next [s].
        skipped: why it was not run, "" when it was.
        failure: the error that ended it, "" when there was none.
        claimed: whether the adapter claims that this way gives the same.
    """

    way: str
    changed: Sequence[str] = ()
    left_at: float | None = None
    skipped: str = ""
    failure: str = ""
    claimed: bool = True

    @property
    def identical(self) -> bool:
        """Whether it ran and every bit was the same."""
        return not (self.skipped or self.failure) and self.first is None

    @property
    def text(self) -> str:
        """The result in words."""
        if self.skipped or self.failure:
            return self.skipped or self.failure
        if self.first is None:
            return "bit-identical"
        gaps = [(after, gap) for after, gap in (self.growth or {}).items() if gap is not None]
        growth = ", ".join(f"{significant(1000 * gap)} mm {after} s later" for after, gap in gaps)
        what = f"first differs at t = {self.first:.2f} s"
        what += f" ({self.body})" if self.body else " (robot)"
        what += f", then {growth}" if growth else ""
        what += f", {significant(1000 * (self.largest or 0.0))} mm at most"
        return what + (f"; changed {', '.join(self.changed)}" if self.changed else "")

    def to_wire(self) -> dict[str, Any]:
        """Plain data."""
        return {**vars(self), "identical": self.identical}


class Replayed(TypedDict):
    """Result of a replay."""

    claims: bool
    again: list[Again]


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

    @property
    def again(self) -> list[Again]:
        """Of a replay, each way of running again."""
        return checked.convert(self.result, Replayed)["again"]


def append(folder: Path, line: Line) -> Unwritten:
    """Write one line to the run folder, else elsewhere; what it returns says where. Never raises
    OSError."""
    file = LinesFile(folder, NAME, noun="repeatability result")
    file.append(json.dumps({"schema": SCHEMA, **vars(line)}))
    return file.close()


def read(folder: Path) -> Found[Line]:
    """The lines of a run, in the order of their tests' ids; none when there is no file. Of what was
    asked again, in a run that was completed, the last one.

    Raises:
        UnreadableError: there is one, and it cannot be read.
    """
    if not os.path.lexists(folder / NAME):
        return Found()
    found = lines.read(folder, NAME, _line)
    last = {_asked(line): line for line in found.items}
    items = sorted(last.values(), key=lambda line: (line.kind, line.task, line.test))
    return replace(found, items=tuple(items))


def _asked(line: Line) -> str:
    parameters = {key: value for key, value in line.settings.items() if key.startswith(TASK)}
    asked = [line.result.get(name) for name in ("bounds", "perturbation")]
    return text([line.kind, line.test, line.task, line.seed, parameters, asked])


def _line(data: dict[str, Any], where: str) -> Line:
    """The result in an object.

    Raises:
        ValueError: it is none of ours.
    """
    schema = data.pop("schema", None)
    try:
        line = checked.convert(checked.plain(data), Line)
        checked.convert(line.result, Replayed if line.kind == "replay" else Told)
    except checked.CheckError:
        raise ValueError(f"{where}: not a result on repeatability") from None
    if schema != SCHEMA:
        raise ValueError(f"{where}: schema {checked.short(schema)}, this reads {SCHEMA}")
    return line
