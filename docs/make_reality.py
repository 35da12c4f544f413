"""Makes the tables of docs/reality.md from docs/data/tossing.csv and docs/data/arm_pushing.csv.

python docs/make_reality.py RUN...    reads run folders into the CSV files, then writes the tables
python docs/make_reality.py           writes the tables

A table stands between `<!-- reality: TASK -->` and `<!-- end -->`.
"""

from __future__ import annotations

import csv
import re
import statistics
import sys
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

from published_runs import SIMULATORS

from pytest_simbench.records.folder import RunFolder

DOCS = Path(__file__).resolve().parent
PAGE = DOCS / "reality.md"
METRICS = {
    "tossing": ("position_error", "rotation_error"),
    "arm_pushing": ("displacement", "displacement_error", "turn_error", "way_error"),
}
HEADER = ("profile", "simulator", "version", "number", "status")
PROFILES = ("default", "tuned", "real")
NAMES = {**SIMULATORS, "ode": "ODE"}

Rows = dict[tuple[str, str], list[dict[str, str]]]
"""Lines of a CSV by simulator and profile."""


def data(task: str) -> Path:
    """Where the repetitions of a task are."""
    return DOCS / "data" / f"{task}.csv"


def read(folders: list[str]) -> None:
    """Run folders into the CSV files."""
    found: dict[str, list[list[str]]] = {task: [] for task in METRICS}
    for folder in folders:
        for record in RunFolder(Path(folder)).read().records:
            if record.task not in METRICS:
                continue
            other = ("python", "pytest-simbench")
            version = next((v for k, v in record.versions.items() if k not in other), "")
            number = str((record.details.get("data") or ["", ""])[1])
            told = [record.profile, record.simulator, version, number, record.status]
            values = [record.metrics.get(name) for name in METRICS[record.task]]
            cells = ["" if value is None else f"{value:.6g}" for value in values]
            found[record.task].append([*told, *cells])
    for task, lines in found.items():
        with data(task).open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerows([[*HEADER, *METRICS[task]], *lines])


def rows(task: str) -> Rows:
    """What was measured."""
    found: Rows = defaultdict(list)
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


TABLES: dict[str, Callable[[], str]] = {"tossing": tossing, "arm_pushing": arm_pushing}


def page() -> str:
    """The page with its tables."""
    return re.sub(
        r"(<!-- reality: (\w+) -->\n).*?(<!-- end -->)",
        lambda found: f"{found[1]}\n{TABLES[found[2]]()}\n{found[3]}",
        PAGE.read_text("utf-8"),
        flags=re.DOTALL,
    )


if __name__ == "__main__":
    if sys.argv[1:]:
        read(sys.argv[1:])
    PAGE.write_text(page(), "utf-8")
