"""How a run ended, kept in its folder: whether tests passed, and the comparison with a baseline.

The records do not say either: what a test claims is in its code, and the baseline is elsewhere.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from pytest_simbench.ground.files import FileError, read_file, read_json
from pytest_simbench.measure.gate import GateReport
from pytest_simbench.records import checked
from pytest_simbench.records.paths import FolderError, inside
from pytest_simbench.records.record import Record

NAME = "outcome.json"

Compared = tuple[str, GateReport]
"""Name of a baseline, and what differs from it."""

SCHEMA = 1

KEPT = ("passed", "looks", "ended", "cut", "open")
"""Attributes that the file has as they are."""

LARGEST = 64 * 2**20
"""[bytes]"""


@dataclass(frozen=True)
class RunOutcome:
    """How a run ended.

    Attributes:
        passed: whether the tests, and the limits against the baseline, passed; None: not known.
        compared: with what, and what differs from it; None when nothing was compared.
        looks: how often the run was gone on with and judged again, with the first time; 0: it has
            begun, and never was.
        ended: whether it came to its end; one that was killed did not.
        cut: tests that were cut short between two repetitions, and not judged.
        open: tests that were begun since the run last ended; none where it has ended.
    """

    passed: bool | None = None
    compared: Compared | None = None
    looks: int = 1
    ended: bool = True
    cut: tuple[str, ...] = ()
    open: tuple[str, ...] = ()

    def to_json(self) -> str:
        """What a run folder keeps of it."""
        found: dict[str, Any] = {"schema": SCHEMA} | {name: getattr(self, name) for name in KEPT}
        if self.compared is not None:
            baseline, report = self.compared
            found["comparison"] = {"baseline": baseline, **asdict(report)}
            for change in _changes(found):
                # In the limit's terms it may be without bounds: of a baseline of 0.
                change["loss"] = str(change["loss"])
        return json.dumps(found)

    @classmethod
    def read(cls, folder: Path) -> tuple[RunOutcome, str]:
        """That of a run folder, which anybody may have made; and what is wrong with it, or "".

        A folder without one says nothing.
        """
        try:
            path = inside(folder, NAME)
            if not path.exists():
                return cls(), ""
            data = checked.plain(read_json(read_file(path, LARGEST, "how the run ended,")))
            checked.schema(data, SCHEMA)
            for change in _changes(data):
                change["loss"] = float(change["loss"])
            whole = {name: data[name] for name in KEPT if name in data}
            if comparison := data.get("comparison"):
                whole["compared"] = comparison.pop("baseline", ""), comparison
            return checked.convert(whole, cls), ""
        except (FolderError, FileError) as error:
            return cls(), str(error)
        except (ValueError, LookupError, TypeError, AttributeError) as error:
            told = f"it lacks {error}" if isinstance(error, KeyError) else error
            return cls(), f"{folder / NAME} does not say how the run ended: {told}"


def _changes(data: Any) -> list[dict[str, Any]]:
    """Every change in the plain data of an outcome.

    Raises:
        KeyError, TypeError, AttributeError: it is none.
    """
    report = data.get("comparison")
    return [] if report is None else [*report["changes"], *report["others"]]


def looks_at(folder: Path, before: Iterable[Record], now: Iterable[Record]) -> int:
    """How often a run has been judged, with this time: one that ended and to one of whose tests
    repetitions were added was looked at before. Tests that are new, of a further release for
    instance, or were cut short before they were judged are looked at for the first time."""
    before = list(before)
    ended = ([r for r in records if r.status != "interrupted"] for records in (before, now))
    old, new = ({(r.test, r.repetition) for r in records} for records in ended)
    cut = {r.test for r in before if (r.test, r.repetition) not in old}
    so_far = _so_far(folder)
    more = {test for test, _ in new - old} & {test for test, _ in old} - cut - {*so_far.cut}
    return max(1, so_far.looks + bool(more))


def cut_at(
    folder: Path, before: Iterable[Record], now: Iterable[Record], judged: Collection[str]
) -> tuple[str, ...]:
    """Tests that have repetitions or were killed, and now or before were not `judged`."""
    so_far = _so_far(folder)
    known = {(r.test, r.repetition) for r in before if r.status != "interrupted"}
    begun = {r.test for r in now if (r.test, r.repetition) not in known}
    return tuple(sorted({*so_far.cut, *so_far.open, *begun}.difference(judged)))


def begun(folder: Path, tests: Iterable[str] = ()) -> RunOutcome:
    """What the folder of a run says until it ends: a killed one says no more."""
    so_far = _so_far(folder)
    found = tuple(sorted({*so_far.open, *tests}))
    return replace(so_far, passed=None, compared=None, ended=False, open=found)


def _so_far(folder: Path) -> RunOutcome:
    """How a run has ended before; one that is new was never looked at."""
    return RunOutcome.read(folder)[0] if (folder / NAME).exists() else RunOutcome(looks=0)
