"""What is measured of a repetition: the metrics a task declares, and the costs every task has."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from functools import partial
from typing import Annotated, Literal, get_args

from msgspec import Meta

from pytest_simbench.records.checked import LONGEST_NAME, Name, Positive, Size

Better = Literal["higher", "lower"]
Kind = Literal["share", "yes_no", "value"]
Word = Annotated[str, Meta(min_length=1, max_length=LONGEST_NAME)]


RESOLUTIONS = {
    "m": 1e-3, "mm": 1.0, "m/s": 5e-3, "s": 1e-3, "rad": 1e-3, "deg": 0.1, "rad/s": 5e-3, "%": 0.1,
}  # fmt: skip
"""Smallest differences that mean anything, by unit: a millimetre is what tables print and what the
start is jittered by; speeds and times are what it is at the release of a throw (2.75 m/s, steps of
1 ms), angles what it is at an arm's reach of 1 m; a tenth of a percent is what tables print. Less
than that between repetitions is a deterministic engine's rounding, not a spread."""


def significant(value: float, digits: int = 3, *, keep_zeros: bool = False) -> str:
    """A number with so many significant digits and never a power of ten: 1.35, 0.8, 161, 1552."""
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    whole = int(f"{value:.{digits - 1}e}".partition("e")[2]) + 1  # digits before the point
    text = f"{value:.{max(0, digits - whole)}f}"
    return text if keep_zeros or "." not in text else text.rstrip("0").rstrip(".")


class UnknownMetric(LookupError):
    """A metric's name that nothing declares; the message lists the valid ones."""

    def __init__(self, name: str, valid: Iterable[str], where: str = "") -> None:
        self.name = name
        self.valid = sorted(valid)
        near = get_close_matches(name, self.valid)
        hint = f"did you mean {near[0]!r}? " if near else ""
        super().__init__(
            f"no metric is named {name!r}{where}; {hint}valid names: {', '.join(self.valid)}"
        )


@dataclass(frozen=True)
class Metric:
    """One number of a repetition, and how to read it.

    Attributes:
        name: its key in a record, for instance `placed`.
        title: its heading in a table.
        unit: of the value, for instance `m`; empty where it has none.
        better: which direction is good. None where neither is: then two values only differ, unless
            the task gives the right one (its `references`), which makes the nearer one better.
        kind: `share`: the mean over `of` things, 0..1, shown in percent; `yes_no`: 0 or 1 for each
            repetition, its mean shown in percent; `value`: a number in `unit`.
        of: how many things a share is of (15 cubes), else None.
        study: whether the reference study reports it too.
        doc: one sentence that says what is counted.
        resolution: the smallest difference that means anything, in its unit; None: by unit, see
            `RESOLUTIONS`, else 0.
        least: the smallest value that there can be, in its unit: 0 for a count or a distance; None
            where there is none. Proportions lie in 0..1 whatever it says.

    Raises:
        ValueError: a share without `of`, or a kind or direction that there is not.
    """

    name: Word
    title: Word
    unit: Name = ""
    better: Better | None = "higher"
    kind: Kind = "value"
    of: Positive | None = None
    study: bool = False
    doc: Name = ""
    resolution: Size | None = None
    least: float | None = None

    def __post_init__(self) -> None:
        for field, value, words in (
            ("kind", self.kind, get_args(Kind)),
            ("better", self.better, (*get_args(Better), None)),
        ):
            if value not in words:
                choice = ", ".join(map(repr, words))
                raise ValueError(f"metric {self.name!r}: {field}={value!r}; choose from {choice}")
        if self.kind == "share" and not self.of:
            raise ValueError(f"metric {self.name!r} is a share: say of how many things (of=...)")

    @property
    def bounded(self) -> bool:
        """Whether it lies in 0..1, so that a mean of it is a proportion."""
        return self.kind != "value"

    def holds(self, value: float) -> bool:
        """Whether it can have that value: yes or no, a share in 0..1, others from their least."""
        if self.kind == "yes_no":
            return value in (0, 1)
        return 0 <= value <= 1 if self.bounded else self.least is None or value >= self.least

    @property
    def smallest_difference(self) -> float:
        """The smallest difference that means anything; 0 for proportions and counts."""
        if self.resolution is not None:
            return self.resolution
        return RESOLUTIONS.get(self.unit, 0.0) if self.kind == "value" else 0.0

    def differs(self, before: float, after: float) -> bool:
        """Whether two means differ by what means anything (`RESOLUTIONS`), and a reader sees it."""
        shown = self.format(before) != self.format(after)
        return shown and abs(after - before) >= self.smallest_difference

    @property
    def crashed(self) -> float | None:
        """What a crashed repetition counts with: the worst that a share or a yes/no metric can be.

        None where there is no worst value (lengths, times) or no good direction: such a metric is
        told of those repetitions that finished.
        """
        if not self.bounded or self.better is None:
            return None
        return 0.0 if self.better == "higher" else 1.0

    def format(self, value: float, digits: int = 3) -> str:
        """The value as a reader sees it: proportions in percent, others with their unit."""
        if self.bounded:
            return f"{significant(100 * value, 4)} %"
        return f"{significant(value, digits)} {self.unit}".rstrip()


_cost = partial(Metric, resolution=0.0, least=0.0)

COSTS: tuple[Metric, ...] = (
    _cost("rtf", "real-time factor", doc="simulated over wall seconds of stepping"),
    _cost("cpu", "CPU", "% of a core", "lower", study=True, doc="mean of worker and children"),
    _cost("ram", "RAM", "MB", "lower", study=True, doc="mean resident memory"),
    _cost("ram_peak", "peak RAM", "MB", "lower", doc="largest resident memory"),
    _cost("cpu_cost", "CPU s per simulated s", "", "lower", doc="CPU over simulated seconds"),
    _cost("start", "task start", "s", "lower", study=True, doc="from launch to task start"),
    _cost("end", "task end", "s", "lower", study=True, doc="from launch to task end"),
    _cost("total", "wall time", "s", "lower", doc="the whole repetition"),
)
"""What a repetition cost, whatever its task; read from the record, see `record.Record.cost`. Costs
always vary, so they have no resolution."""

CRASHED = Metric(
    "crashed", "crashed repetitions", better="lower", kind="yes_no", doc="1 for each that crashed"
)
"""The share of crashed repetitions, as a metric of every task."""
