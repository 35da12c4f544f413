"""Makes the tables of docs/pushing.md from docs/data/pushing.csv, which holds every repetition.

python docs/make_pushing.py RUN...    adds run folders to the CSV, then writes the tables
python docs/make_pushing.py           writes the tables

A table stands between `<!-- pushing: ROBOT PROFILE -->` and `<!-- end -->`.
"""

from __future__ import annotations

import csv
import statistics
import sys
from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path

from published_runs import SIMULATORS
from tables import engine_version, filled

from pytest_simbench.records.folder import RunFolder
from pytest_simbench.tasks import Pushing

DOCS = Path(__file__).resolve().parent
DATA, PAGE = DOCS / "data" / "pushing.csv", DOCS / "pushing.md"
METRICS = {"position_error": 1000.0, "heading_error": 1.0, "path_error": 1000.0}
"""And what makes millimetres of them."""

ERRORS = ("position mm", "heading deg", "path mm")
HEADER = ("robot", "profile", "simulator", "version", "way", "seed", "status")
NAMES = {**SIMULATORS, "ode": "ODE"}


def read(folders: list[str]) -> None:
    """Run folders into the CSV. A repetition that is in it already is replaced."""
    names = [metric.name for metric in Pushing().metrics]
    with DATA.open(newline="", encoding="utf-8") as file:
        rows = {_key(row): row for row in csv.DictReader(file)}
    for folder in folders:
        for record in RunFolder(Path(folder)).read().records:
            robot = record.robot.get("name", "panda")
            way = "curve" if record.settings["task.turn"] else "line"
            told = (record.simulator, engine_version(record), way, record.seed, record.status)
            values = [record.metrics.get(name) for name in names]
            cells = ["" if value is None else f"{value:.6g}" for value in values]
            line = (robot, record.profile, *map(str, told), *cells)
            row = dict(zip((*HEADER, *names), line, strict=True))
            rows[_key(row)] = row
    with DATA.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, (*HEADER, *names), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows.values())


def _key(row: Mapping[str, str]) -> tuple[str, ...]:
    return tuple(row[name] for name in ("robot", "profile", "simulator", "way", "seed"))


def table(robot: str, profile: str) -> str:
    """Mean of each error, and in brackets the largest."""
    with DATA.open(newline="", encoding="utf-8") as file:
        lines = [r for r in csv.DictReader(file) if (r["robot"], r["profile"]) == (robot, profile)]
    rows: dict[str, dict[str, list[dict[str, str]]]] = defaultdict(lambda: defaultdict(list))
    for line in lines:
        rows[line["simulator"]][line["way"]].append(line)
    errors = [f"{way}: {error}" for way in ("line", "curve") for error in ERRORS]
    text = [f"| simulator | {' | '.join(errors)} | tipped |", "| :-- |" + " --: |" * 7]
    for name in (name for name in NAMES if name in rows):
        cells = [NAMES[name]]
        for way in ("line", "curve"):
            cells += [_cell(rows[name][way], metric) for metric in METRICS]
        found = [line for ways in rows[name].values() for line in ways]
        tipped = sum(float(line["tipped"] or 0) for line in found)
        cells.append(f"{tipped:g} of {len(found)}")
        text.append(f"| {' | '.join(cells)} |")
    return "\n".join(text)


def _cell(lines: list[dict[str, str]], metric: str) -> str:
    values = [METRICS[metric] * float(line[metric]) for line in lines if line[metric]]
    if not values:
        return "-"
    digits = 2 if metric == "heading_error" else 1
    return f"{statistics.fmean(values):.{digits}f} [{max(values):.{digits}f}]"


def page() -> str:
    """The page with its tables."""
    return filled(PAGE, "pushing", table)


if __name__ == "__main__":
    if sys.argv[1:]:
        read(sys.argv[1:])
    PAGE.write_text(page(), "utf-8")
