"""Makes the tables of docs/truth.md from docs/data/truth.csv, which holds every law of every run,
and those of it and of docs/data/sweep.md from docs/data/sweep.csv: laws over time steps.

python docs/make_truth.py RUN...            reads run folders into truth.csv, whose other lines
                                            stay, then writes the tables
python docs/make_truth.py --sweep RUN...    the same into sweep.csv, and draws its pictures
python docs/make_truth.py                   writes the tables

A table stands between `<!-- truth: PART PROFILE -->` and `<!-- end -->`; PART is `sentences`,
`phenomena`, `laws` or `list`, and with the word `sweep` in place of a profile `steps`, `orders`
(of free motion), `cheapest` (all phenomena), `broken` or `failures`.
"""

from __future__ import annotations

import csv
import sys
from dataclasses import replace
from pathlib import Path

from tables import engine_version, filled

from pytest_simbench.ground.text import for_markdown
from pytest_simbench.laws import LAWS
from pytest_simbench.measure.sweep import Swept, sweeps
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.notes import Notes
from pytest_simbench.records.phenomena import PHENOMENA, PHENOMENON
from pytest_simbench.records.readings import Reading
from pytest_simbench.records.record import Failure, Record
from pytest_simbench.report.figures import sweep as figures
from pytest_simbench.report.figures.drawing import drawing
from pytest_simbench.report.markdown import run as markdown
from pytest_simbench.report.model import sweep, truth
from pytest_simbench.report.model.summary import TaskSummary, summarise

DOCS = Path(__file__).resolve().parent
DATA, PAGE = DOCS / "data" / "truth.csv", DOCS / "truth.md"
PAGES = (PAGE, DOCS / "data" / "sweep.md")
SWEEP, PICTURES = DOCS / "data" / "sweep.csv", DOCS / "pictures"
DRAWN = "free motion"
"""Whose pictures are on the page."""
READING = ("value", "exact", "tolerance")
HEADER = (
    "profile", "simulator", "version", "timestep", "phenomenon", "law", "status", *READING,
    "error", "ratio", "unit", "cpu", "simulated",
)  # fmt: skip
SWEPT = ("own", "steps", "message")
"""Columns of sweep.csv beside these."""
BY_NAME = {law.name: law for law in LAWS}


def read(folders: list[str], swept: bool = False) -> None:
    """Run folders into the CSV; of a sweep into its own. Lines that no folder has anew stay."""
    path, header = SWEEP if swept else DATA, HEADER + SWEPT * swept
    same = [header.index(name) for name in ("profile", "simulator", "law", *["timestep"] * swept)]
    with path.open(newline="", encoding="utf-8") as file:
        lines = list(csv.reader(file))[1:]
    known = {tuple(line[k] for k in same): line for line in lines}
    for record in (r for f in folders for r in RunFolder(Path(f)).read().records):
        if PHENOMENON in record.settings and (swept or not record.swept):
            line = [str(cell) for cell in _line(record) + _of_sweep(record) * swept]
            known[tuple(line[k] for k in same)] = line
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([header, *known.values()])


def _line(record: Record) -> list[object]:
    numbers = [getattr(record.notes.reading, name, None) for name in READING]
    numbers += [record.metrics.get(name) for name in ("error", "ratio")]
    costs = [record.stepping.get(name) for name in ("cpu", "simulated")]
    return [
        record.profile, record.simulator, engine_version(record), record.settings["timestep"],
        record.settings[PHENOMENON], record.task, record.status,
        *map(_text, numbers), BY_NAME[record.task].unit, *map(_text, costs),
    ]  # fmt: skip


def _of_sweep(record: Record) -> list[object]:
    message = " ".join(record.error.message.split()) if record.error else ""
    return [
        _text(record.notes.own_timestep), _text(record.stepping.get("steps")), message
    ]  # fmt: skip


def _text(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"


def found_sweeps() -> list[Swept]:
    """What sweep.csv tells, laws in their order."""
    with SWEEP.open(newline="", encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    order = list(BY_NAME)
    lines.sort(key=lambda line: order.index(line["law"]))
    metrics = {name: law.metrics for name, law in BY_NAME.items()}
    return sweeps([_record_of_sweep(line) for line in lines], metrics)


def _record_of_sweep(line: dict[str, str]) -> Record:
    told = [float(line[name]) for name in READING if line[name]]
    plain = _record(line)
    return replace(
        plain,
        settings={**plain.settings, "timestep": float(line["timestep"])},
        stepping={**plain.stepping, **({"steps": float(line["steps"])} if line["steps"] else {})},
        notes=Notes(
            reading=Reading(*told) if len(told) == len(READING) else None,
            own_timestep=float(line["own"]) if line["own"] else None,
        ),
        error=None if plain.ok else Failure("", line["message"]),
    )


def draw() -> None:
    """The pictures of the page."""
    found = found_sweeps()
    with drawing():
        for over in figures.OVER:
            path = PICTURES / f"sweep_{DRAWN.replace(' ', '_')}_{over}.png"
            figures.draw(found, DRAWN, over).savefig(path, dpi=90)


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
        function="test_law",
        variant=line["law"],
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
    if profile == "sweep":
        return _sweep(name)
    found = summaries(profile)
    if name == "sentences":
        return "\n".join(f"- {text}" for text in truth.sentences(found))
    if name == "phenomena":
        return markdown.table(truth.table(found))
    texts = [f"{each.title}:\n\n{markdown.table(each.columns)}" for each in truth.details(found)]
    return "\n\n".join(text[0].upper() + text[1:] for text in texts)


def _sweep(name: str) -> str:
    """One table of laws over time steps."""
    found = found_sweeps()
    if name == "steps":
        return markdown.table(sweep.table(found))
    tables = {each.title: each.columns for each in sweep.details(found)}
    if name == "failures":
        failed = [table for title, table in tables.items() if title.startswith("what failed")]
        return "\n".join(map(markdown.table, failed)) or "Nothing failed."
    if name == "broken":
        return markdown.table(tables[sweep.BROKEN])
    if name == "orders":
        return markdown.table(tables[f"{DRAWN}: order of convergence"])
    texts = [
        f"{title[0].upper()}{title[1:]}:\n\n{markdown.table(table)}"
        for title, table in tables.items()
        if title.partition(":")[0] in PHENOMENA
    ]
    return "\n\n".join(texts)


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


def page(path: Path = PAGE) -> str:
    """A page with its tables."""
    return filled(path, "truth", part)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--sweep"]:
        read(sys.argv[2:], swept=True)
        draw()
    elif sys.argv[1:]:
        read(sys.argv[1:])
    for path in PAGES:
        path.write_text(page(path), "utf-8")
