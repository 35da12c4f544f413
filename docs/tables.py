"""What the pages' tables are made of: the CSVs in docs/data with a line for each repetition."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pytest_simbench.records.record import Record

DOCS = Path(__file__).resolve().parent
DATA = DOCS / "data"

SIMULATORS = {
    "mujoco": "MuJoCo", "pybullet": "PyBullet", "sapien": "SAPIEN", "ovphysx": "Omniverse PhysX",
    "drake": "Drake", "dart": "DART", "newton": "Newton", "genesis": "Genesis",
}  # fmt: skip
"""Those of stacking.csv and throwing.csv."""
NAMES = {**SIMULATORS, "ode": "ODE", "gazebo": "Gazebo", "coppeliasim": "CoppeliaSim"}

Line = dict[str, str]


@dataclass(frozen=True)
class Kept:
    """A CSV of docs/data.

    Attributes:
        name: of the file, without its ending.
        key: columns by which a repetition is known; a newer one replaces the older one.
        columns: all of them.
        told: what a record says, by column; None of a record that is no matter of this file.
            Simulator, profile, seed, status and the engine's version need not be told.
    """

    name: str
    key: tuple[str, ...]
    columns: tuple[str, ...]
    told: Callable[[Record], Mapping[str, object] | None]

    def lines(self, **where: str) -> list[Line]:
        """Those that have these values."""
        with (DATA / f"{self.name}.csv").open(encoding="utf-8", newline="") as file:
            found = list(csv.DictReader(file))
        return [line for line in found if all(line[k] == value for k, value in where.items())]

    def read(self, records: Iterable[Record], **more: str) -> None:
        """Put the repetitions of a run into the file; `more` are columns that no record tells."""
        rows = {tuple(line[k] for k in self.key): line for line in self.lines()}
        for record in records:
            told = self.told(record) if record.status != "interrupted" else None
            if told is not None:
                cells = {**_of_every(record), **told, **more}
                line = {name: _text(cells.get(name)) for name in self.columns}
                rows[tuple(line[k] for k in self.key)] = line
        with (DATA / f"{self.name}.csv").open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, self.columns, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows.values())


def _of_every(record: Record) -> dict[str, object]:
    own = ("python", "pytest-simbench")
    version = next((v for k, v in record.versions.items() if k not in own), "")
    names = ("simulator", "profile", "task", "seed", "status")
    return {**{name: getattr(record, name) for name in names}, "version": version}


def _text(value: object) -> str:
    if value is None or isinstance(value, str):
        return value or ""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def table(headings: Sequence[str], rows: Iterable[Sequence[str]], left: int = 1) -> str:
    """A Markdown table; all but the first `left` columns are numbers."""
    marks = [":--" if k < left else "--:" for k in range(len(headings))]
    return "\n".join(f"| {' | '.join(row)} |" for row in (headings, marks, *rows))


def numbers(lines: Iterable[Line], metric: str, scale: float = 1.0) -> list[float]:
    """The values of a metric, where there is one."""
    return [scale * float(line[metric]) for line in lines if line[metric]]
