"""How a run ended, kept in its folder: whether tests passed, and the comparison with a baseline.

The records do not say either: what a test claims is in its code, and the baseline is elsewhere.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pytest_simbench.measure.comparison import MeanDifference
from pytest_simbench.measure.gate import Change, GateReport
from pytest_simbench.measure.limits import Limit
from pytest_simbench.records import checked
from pytest_simbench.records.description import TaskDescription, TaskDescriptionError
from pytest_simbench.records.paths import FolderError, inside, write_whole
from pytest_simbench.simulator.files import FileError, read_file, read_json

NAME = "outcome.json"

SCHEMA = 1

LARGEST = 64 * 2**20
"""[bytes]"""

TEXTS = ("differences", "broken", "notes")


@dataclass(frozen=True)
class Outcome:
    """How a run ended.

    Attributes:
        passed: whether the tests, and the limits against the baseline, passed; None: not known.
        baseline: name of what it was compared with.
        comparison: what differs from it; None when nothing was compared.
    """

    passed: bool | None = None
    baseline: str = ""
    comparison: GateReport | None = None

    @property
    def compared(self) -> tuple[str, GateReport] | None:
        """Name of the baseline and what differs from it, as the page takes them."""
        return None if self.comparison is None else (self.baseline, self.comparison)

    def write(self, folder: Path) -> None:
        """Write it into a run folder.

        Raises:
            OSError: it cannot be written.
        """
        found: dict[str, Any] = {"schema": SCHEMA, "passed": self.passed}
        if self.comparison is not None:
            report = self.comparison
            found["comparison"] = {
                "baseline": self.baseline,
                **{name: list(getattr(report, name)) for name in TEXTS},
                "changes": [_change(change) for change in report.changes],
                "others": [_change(change) for change in report.others],
            }
        write_whole(folder, NAME, json.dumps(found).encode())

    @classmethod
    def read(cls, folder: Path) -> tuple[Outcome, str]:
        """That of a run folder, which anybody may have made; and what is wrong with it, or "".

        A folder without one says nothing.
        """
        try:
            path = inside(folder, NAME)
            if not path.exists():
                return cls(), ""
            data = checked.plain(read_json(read_file(path, LARGEST, "how the run ended,")))
            return cls._read(data), ""
        except (FolderError, FileError) as error:
            return cls(), str(error)
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            told = f"it lacks {error}" if isinstance(error, KeyError) else error
            return cls(), f"{folder / NAME} does not say how the run ended: {told}"

    @classmethod
    def _read(cls, data: Any) -> Outcome:
        if data.get("schema", SCHEMA) != SCHEMA:
            raise ValueError("it is of a newer version")
        checked.one_of(data.get("passed"), "passed", (True, False, None))
        found = data.get("comparison")
        if found is None:
            return cls(data.get("passed"))
        report = GateReport(
            **{name: tuple(checked.writable(text) for text in found[name]) for name in TEXTS},
            changes=tuple(map(_changed, found["changes"])),
            others=tuple(map(_changed, found["others"])),
        )
        return cls(data.get("passed"), checked.name(found["baseline"], "baseline"), report)


def _change(change: Change) -> dict[str, Any]:
    mean = change.comparison
    return {
        "test": change.test,
        "metric": change.metric.to_wire(),
        "limit": {**vars(change.limit)},
        "comparison": {**vars(mean), "n": list(mean.n)},
        "p_value": change.p_value,
        # In the limit's terms it may be without bounds: of a baseline of 0.
        "loss": change.loss if math.isfinite(change.loss) else str(change.loss),
        "normalised": change.normalised,
    }


def _changed(data: Mapping[str, Any]) -> Change:
    try:
        metric = TaskDescription.from_dict({"task": "-", "metrics": [data["metric"]]}).metrics[0]
    except TaskDescriptionError as error:
        raise ValueError(str(error)) from None
    limit, mean = data["limit"], data["comparison"]
    first, second, p_value = (float(mean[key]) for key in ("first", "second", "p_value"))
    before, after = map(int, mean["n"])
    return Change(
        checked.name(data["test"], "test"),
        metric,
        Limit(
            checked.name(limit["metric"], "metric"), float(limit["amount"]), bool(limit["percent"])
        ),
        MeanDifference(first, second, p_value, bool(mean["paired"]), (before, after)),
        float(data["p_value"]),
        float(data["loss"]),
        bool(data["normalised"]),
    )
