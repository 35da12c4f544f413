"""Makes the tables of other arms in docs/results.md from docs/data/arms.csv: every repetition.

python docs/make_arms.py RUN...    adds run folders to the CSV, then writes the tables
python docs/make_arms.py           writes the tables

A table stands between `<!-- arms: TASK -->` and `<!-- end -->`.
"""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

from published_runs import METRICS, SIMULATORS, TASKS, Run
from tables import engine_version, filled

from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.record import Record
from pytest_simbench.simulator.registry import adapter

DOCS = Path(__file__).resolve().parent
DATA, PAGE = DOCS / "data" / "arms.csv", DOCS / "results.md"
ROBOTS = {"ur5": "UR5", "ur10": "UR10", "xarm7": "xArm 7", "so101": "SO-101"}
SHOWN = {
    "stacking": {
        "placed": "placed %",
        "at_end": "at the end %",
        "at_end_strict": "strict %",
        "failed_picks": "failed picks",
    },
    "throwing": {
        "hit": "hits",
        "moved": "moved %",
        "lost_in_transit": "lost",
        "landing_x": "landing x",
        "limits": "limits %",
    },
}
IDENTITY = ("robot", "task", "profile", "simulator", "changed", "seed")
HEADER = (*IDENTITY, "version", "status")
COLUMNS = (*HEADER, *dict.fromkeys(m.name for task in TASKS.values() for m in task.metrics))
NAMES = {**SIMULATORS, "ode": "ODE"}


def read(folders: list[str]) -> None:
    """Run folders into the CSV. A repetition that is in it already is replaced."""
    rows = {_key(row): row for row in lines()}
    for folder in folders:
        for record in RunFolder(Path(folder)).read().records:
            identity = (record.robot["name"], record.task, record.profile, record.simulator)
            seed, version = str(record.seed), engine_version(record)
            told = (*identity, _changed(record), seed, version, record.status)
            known = {name: x for name, x in record.metrics.items() if x is not None}
            values = {name: f"{value:.6g}" for name, value in known.items()}
            row = {**dict.fromkeys(COLUMNS, ""), **dict(zip(HEADER, told, strict=True)), **values}
            rows[_key(row)] = row
    with DATA.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows[key] for key in sorted(rows))


def _changed(record: Record) -> str:
    """The settings that are not the profile's."""
    settings = asdict(adapter(record.simulator).profiles[record.profile])
    profile = json.loads(json.dumps(settings))  # as a record has it
    told = {name: record.settings[name] for name in profile}
    return " ".join(f"{name}={value}" for name, value in told.items() if value != profile[name])


def lines() -> list[dict[str, str]]:
    """What the CSV holds."""
    if not DATA.exists():
        return []
    with DATA.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def _key(row: Mapping[str, str]) -> tuple[str, ...]:
    return tuple(row[name] for name in IDENTITY)


def table(task: str) -> str:
    """A row for each arm, simulator and change of settings: mean and 95 % interval."""
    shown = SHOWN[task]
    titles = ("arm", "simulator", "repetitions", *shown.values())
    text = [f"| {' | '.join(titles)} |", "| :-- | :-- |" + " --: |" * (len(titles) - 2)]
    runs: dict[tuple[str, ...], Run] = {}
    for line in lines():
        if line["task"] == task:
            key = (line["robot"], line["simulator"], line["changed"])
            runs.setdefault(key, Run(task, [])).lines.append(line)
    for robot, simulator, changed in sorted(runs, key=_order):
        run = runs[robot, simulator, changed]
        name = " ".join([NAMES[simulator], *(f"`{change}`" for change in changed.split())])
        told = (ROBOTS[robot], name, run.repetitions)
        text.append(f"| {' | '.join([*told, *(_cell(run, name) for name in shown)])} |")
    return "\n".join(text)


def _order(key: tuple[str, ...]) -> tuple[int, int, str]:
    robot, simulator, changed = key
    return list(ROBOTS).index(robot), list(NAMES).index(simulator), changed


def _cell(run: Run, name: str) -> str:
    if METRICS[run.task][name].kind == "value":
        mean = run.mean(name)
        return "-" if mean is None else f"{mean:.{3 if abs(mean) < 10 else 0}f}"
    return run.cell(name)


def page() -> str:
    """The page with its tables."""
    return filled(PAGE, "arms", table)


if __name__ == "__main__":
    if sys.argv[1:]:
        read(sys.argv[1:])
    PAGE.write_text(page(), "utf-8")
