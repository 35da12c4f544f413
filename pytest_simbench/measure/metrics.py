"""What is measured of a repetition: the metrics a task declares, and the costs every task has."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from difflib import get_close_matches
from typing import Any, Literal

Better = Literal["higher", "lower"]
Kind = Literal["share", "yes_no", "value"]


class UnknownMetric(LookupError):
    """A metric's name that nothing declares; the message lists the valid ones."""

    def __init__(self, name: str, valid: Iterable[str], where: str = "") -> None:
        self.name = name
        self.valid = sorted(valid)
        near = get_close_matches(name, self.valid, n=1)
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
        better: which direction is good, or None where neither is.
        kind: `share`: the mean over `of` things, 0..1, shown in percent; `yes_no`: 0 or 1 for each
            repetition, its mean shown in percent; `value`: a number in `unit`.
        of: how many things a share is of (15 cubes), else None.
        study: whether the reference study reports it too.
        doc: one sentence that says what is counted.

    Raises:
        ValueError: a share without `of`.
    """

    name: str
    title: str
    unit: str = ""
    better: Better | None = "higher"
    kind: Kind = "value"
    of: int | None = None
    study: bool = False
    doc: str = ""

    def __post_init__(self) -> None:
        if self.kind == "share" and not self.of:
            raise ValueError(f"metric {self.name!r} is a share: say of how many things (of=...)")

    @property
    def bounded(self) -> bool:
        """Whether it lies in 0..1, so that a mean of it is a proportion."""
        return self.kind != "value"

    def to_wire(self) -> dict[str, Any]:
        """Plain data: the arguments that make it again."""
        return {item.name: getattr(self, item.name) for item in fields(self)}

    def format(self, value: float, digits: int = 3) -> str:
        """The value as a reader sees it: proportions in percent, others with their unit."""
        if self.bounded:
            return f"{100 * value:.4g} %"
        return f"{value:.{digits}g} {self.unit}".rstrip()


COSTS: tuple[Metric, ...] = (
    Metric("rtf", "real-time factor", "", "higher", doc="simulated over wall seconds of stepping"),
    Metric("cpu", "CPU", "% of a core", "lower", study=True, doc="mean of worker and children"),
    Metric("ram", "RAM", "MB", "lower", study=True, doc="mean resident memory"),
    Metric("ram_peak", "peak RAM", "MB", "lower", doc="largest resident memory"),
    Metric("cpu_cost", "CPU s per simulated s", "", "lower", doc="CPU over simulated seconds"),
    Metric("start", "task start", "s", "lower", study=True, doc="from launch to task start"),
    Metric("end", "task end", "s", "lower", study=True, doc="from launch to task end"),
    Metric("total", "wall time", "s", "lower", doc="the whole repetition"),
)
"""What a repetition cost, whatever its task; read from the record, see `record.Record.cost`."""
