"""Makes the tables of docs/reality.md from docs/data/tossing.csv, arm_pushing.csv and so on.

python docs/make_reality.py RUN...    reads run folders into the CSV files, then writes the tables;
                                      lines of simulators and profiles that are in no run stay
python docs/make_reality.py           writes the tables

A table stands between `<!-- reality: TASK -->` and `<!-- end -->`.
"""

from __future__ import annotations

import csv
import statistics
import sys
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

from published_runs import SIMULATORS
from tables import engine_version, filled

from pytest_simbench.records.folder import RunFolder

DOCS = Path(__file__).resolve().parent
PAGE = DOCS / "reality.md"
METRICS = {
    "tossing": ("position_error", "rotation_error"),
    "arm_pushing": ("displacement", "displacement_error", "turn_error", "way_error"),
    "arm_following": ("hand_error", "rest_error"),
    "arm_following_corrected": ("hand_error", "rest_error"),
}
FOLLOWING = ("arm_following", "arm_following_corrected")
EXPERIMENTS = ("Single", "CubeExp")
HEADER = ("profile", "simulator", "version", "number", "status")
PROFILES = ("default", "tuned", "real")
NAMES = {**SIMULATORS, "ode": "ODE"}

Rows = dict[tuple[str, str], list[dict[str, str]]]
"""Lines of a CSV by simulator and profile."""


def data(task: str) -> Path:
    """Where the repetitions of a task are."""
    return DOCS / "data" / f"{task}.csv"


def columns(task: str) -> tuple[str, ...]:
    """Of a task's CSV file; the cube's displacement is no metric of those that follow commands."""
    return (*HEADER, *METRICS[task], *(("displacement",) if task in FOLLOWING else ()))


def read(folders: list[str]) -> None:
    """Run folders into the CSV files."""
    found: dict[str, list[list[str]]] = {task: [] for task in METRICS}
    for folder in folders:
        for record in RunFolder(Path(folder)).read().records:
            if record.task not in METRICS:
                continue
            number = str((record.details.get("data") or ["", ""])[1])
            if record.task in FOLLOWING:
                number = record.details.get("run", number)
            version = engine_version(record)
            told = [record.profile, record.simulator, version, number, record.status]
            held = {**record.details, **record.metrics}
            values = [held.get(name) for name in columns(record.task)[len(HEADER) :]]
            cells = ["" if value is None else f"{value:.6g}" for value in values]
            found[record.task].append([*told, *cells])
    for task, lines in found.items():
        measured = {(line[1], line[0]) for line in lines}
        kept = [
            [line[name] for name in columns(task)]
            for key, old in rows(task).items()
            if key not in measured
            for line in old
        ]
        with data(task).open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerows([columns(task), *kept, *lines])


def rows(task: str) -> Rows:
    """What was measured."""
    found: Rows = defaultdict(list)
    if not data(task).exists():
        return found
    with data(task).open(newline="", encoding="utf-8") as file:
        for line in csv.DictReader(file):
            found[line["simulator"], line["profile"]].append(line)
    return found


def tossing() -> str:
    """Mean and standard deviation over the tosses."""
    found = rows("tossing")
    heads = [
        f"{profile}: {what}" for profile in PROFILES for what in ("position %", "rotation deg")
    ]
    text = [f"| simulator | {' | '.join(heads)} |", "| :-- |" + " --: |" * len(heads)]
    for name in NAMES:
        cells = [NAMES[name]]
        for profile in PROFILES:
            for metric in METRICS["tossing"]:
                cells.append(_cell(found[name, profile], metric))
        if len(set(cells[1:])) > 1:
            text.append(f"| {' | '.join(cells)} |")
    return "\n".join(text)


def arm_pushing() -> str:
    """Means, and in brackets the largest."""
    found = rows("arm_pushing")
    heads = ("displacement mm", "its error mm", "turn's error deg", "way's error mm")
    text = [f"| simulator | profile | {' | '.join(heads)} |", "| :-- | :-- |" + " --: |" * 4]
    for name in NAMES:
        for profile in PROFILES:
            lines = [line for line in found[name, profile] if line["displacement"]]
            if lines:
                cells = [_largest(lines, metric) for metric in METRICS["arm_pushing"]]
                text.append(f"| {NAMES[name]} | {profile} | {' | '.join(cells)} |")
    return "\n".join(text)


def arm_following() -> str:
    """Means over the runs of each experiment, commands as given and corrected."""
    found = {task: rows(task) for task in FOLLOWING}
    heads = ("free motion mm", "push mm", "cube moved mm")
    both = [*(f"given: {head}" for head in heads), *(f"corrected: {head}" for head in heads)]
    text = [f"| simulator | runs | {' | '.join(both)} |", "| :-- |" + " --: |" * (len(both) + 1)]
    for name in NAMES:
        cells = [NAMES[name], str(len(found[FOLLOWING[0]][name, "real"]))]
        for task in FOLLOWING:
            lines = found[task][name, "real"]
            free, push = ([x for x in lines if x["number"].startswith(e)] for e in EXPERIMENTS)
            for part, metric in (
                (free, "hand_error"), (push, "hand_error"), (push, "displacement")
            ):  # fmt: skip
                values = _values(part, metric)
                cells.append(f"{1000 * statistics.fmean(values):.1f}" if values else "-")
        if set(cells[2:]) != {"-"}:
            text.append(f"| {' | '.join(cells)} |")
    return "\n".join(text)


def source_simulations() -> str:
    """What the source's own simulations have (`benchmarks/source_simulations.py`)."""
    heads = ("free motion mm", "push mm", "cube moved mm")
    text = [f"| the source's | {' | '.join(heads)} |", "| :-- |" + " --: |" * len(heads)]
    cells: dict[str, list[str]] = defaultdict(list)
    with (DOCS / "data" / "source_simulations.csv").open(newline="", encoding="utf-8") as file:
        for line in csv.DictReader(file):
            names = ("hand_error",) if line["experiment"] == "Single" else (
                "hand_error", "displacement",
            )  # fmt: skip
            for metric in names:
                value = line[metric]
                told = f"{1000 * float(value):.1f}" if value else "diverged"
                cells[line["simulator"]].append(told)
    return "\n".join([*text, *(f"| {name} | {' | '.join(row)} |" for name, row in cells.items())])


def _values(lines: list[dict[str, str]], metric: str) -> list[float]:
    return [float(line[metric]) for line in lines if line[metric]]


def _cell(lines: list[dict[str, str]], metric: str) -> str:
    values = _values(lines, metric)
    if not values:
        return "-"
    return f"{statistics.fmean(values):.1f} ± {statistics.pstdev(values):.1f}"


def _largest(lines: list[dict[str, str]], metric: str) -> str:
    scale = 1.0 if metric == "turn_error" else 1000.0
    values = [scale * value for value in _values(lines, metric)]
    return f"{statistics.fmean(values):.1f} [{max(values):.1f}]"


TABLES: dict[str, Callable[[], str]] = {
    "tossing": tossing,
    "arm_pushing": arm_pushing,
    "arm_following": arm_following,
    "source_simulations": source_simulations,
}


def page() -> str:
    """The page with its tables."""
    return filled(PAGE, "reality", lambda task: TABLES[task]())


if __name__ == "__main__":
    if sys.argv[1:]:
        read(sys.argv[1:])
    PAGE.write_text(page(), "utf-8")
