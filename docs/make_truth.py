"""Makes the tables of docs/truth.md from docs/data/truth.csv, which holds every law of every run.

python docs/make_truth.py RUN...    reads run folders into the CSV, then writes the tables
python docs/make_truth.py           writes the tables

A table stands between `<!-- truth: PART PROFILE -->` and `<!-- end -->`; PART is `sentences`,
`phenomena`, `laws` or `list`.
"""

from __future__ import annotations

import csv
import re
import sys
from pathlib import Path

from pytest_simbench.laws import LAW, LAWS
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.record import Record
from pytest_simbench.records.text import for_markdown
from pytest_simbench.report import markdown, truth
from pytest_simbench.report.summary import TaskSummary, summarise
from pytest_simbench.tasks.phenomena import PHENOMENON

DOCS = Path(__file__).resolve().parent
DATA, PAGE = DOCS / "data" / "truth.csv", DOCS / "truth.md"
READING = ("value", "exact", "tolerance")
HEADER = (
    "profile", "simulator", "version", "timestep", "phenomenon", "law", "status", *READING,
    "error", "ratio", "unit", "cpu", "simulated",
)  # fmt: skip
BY_NAME = {law.name: law for law in LAWS}


def read(folders: list[str]) -> None:
    """Run folders into the CSV."""
    with DATA.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(HEADER)
        for record in (r for f in folders for r in RunFolder(Path(f)).read().records):
            if PHENOMENON not in record.settings:
                continue
            other = ("python", "pytest-simbench")
            version = next((v for k, v in record.versions.items() if k not in other), "")
            told = record.details.get(LAW, {})
            numbers = [told.get(name) for name in READING]
            numbers += [record.metrics.get(name) for name in ("error", "ratio")]
            costs = [record.stepping.get(name) for name in ("cpu", "simulated")]
            writer.writerow(
                [
                    record.profile, record.simulator, version, record.settings["timestep"],
                    record.settings[PHENOMENON], record.task, record.status,
                    *map(_text, numbers), BY_NAME[record.task].unit, *map(_text, costs),
                ]
            )  # fmt: skip


def _text(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"


def summaries(profile: str) -> list[TaskSummary]:
    """What the CSV tells of one profile, laws in their order."""
    with DATA.open(newline="", encoding="utf-8") as file:
        lines = [line for line in csv.DictReader(file) if line["profile"] == profile]
    order = list(BY_NAME)
    lines.sort(key=lambda line: order.index(line["law"]))
    metrics = {name: law.metrics for name, law in BY_NAME.items()}
    return summarise([_record(line) for line in lines], metrics)


def _record(line: dict[str, str]) -> Record:
    return Record(
        test=f"test_law[{line['simulator']}-headless-{line['law']}]",
        task=line["law"],
        simulator=line["simulator"],
        mode="headless",
        profile=line["profile"],
        repetition=1,
        seed=0,
        status="ok" if line["status"] == "ok" else "failed",
        metrics={name: float(line[name]) for name in ("error", "ratio") if line[name]},
        stepping={name: float(line[name]) for name in ("cpu", "simulated") if line[name]},
        settings={PHENOMENON: line["phenomenon"]},
    )


def part(name: str, profile: str) -> str:
    """One table, or the sentences."""
    if name == "list":
        return _list()
    found = summaries(profile)
    if name == "sentences":
        return "\n".join(f"- {text}" for text in truth.sentences(found))
    if name == "phenomena":
        return markdown.table(truth.table(found))
    texts = [f"{title}:\n\n{markdown.table(table)}" for title, table in truth.details(found)]
    return "\n\n".join(text[0].upper() + text[1:] for text in texts)


def _list() -> str:
    """Every law in the words of its docstring."""
    lines = ["| law | phenomenon | what is measured | what is right, and the tolerance |",
             "| :-- | :-- | :-- | :-- |"]  # fmt: skip
    for law in LAWS:
        told = " ".join((type(law).__doc__ or "").split())
        unit = f" [{law.unit}]" if law.unit else ""
        cells = (law.name, law.phenomenon, law.quantity + unit, told)
        lines.append(f"| {' | '.join(for_markdown(cell, cell=True) for cell in cells)} |")
    return "\n".join(lines)


def page() -> str:
    """The page with its tables."""
    return re.sub(
        r"(<!-- truth: (\w+) (\w+) -->\n).*?(<!-- end -->)",
        lambda found: f"{found[1]}\n{part(found[2], found[3])}\n{found[4]}",
        PAGE.read_text("utf-8"),
        flags=re.DOTALL,
    )


if __name__ == "__main__":
    if sys.argv[1:]:
        read(sys.argv[1:])
    PAGE.write_text(page(), "utf-8")
