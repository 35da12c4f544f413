"""Tables of laws, from truth.csv, and of laws over time steps, from sweep.csv."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

from tables import DOCS, Kept, Line, table

from pytest_simbench.ground.text import for_markdown
from pytest_simbench.laws import LAWS
from pytest_simbench.measure.sweep import Swept, sweeps
from pytest_simbench.records.notes import Notes
from pytest_simbench.records.phenomena import PHENOMENA, PHENOMENON
from pytest_simbench.records.readings import Reading
from pytest_simbench.records.record import Failure, Record
from pytest_simbench.report.figures import sweep as figures
from pytest_simbench.report.figures.drawing import drawing
from pytest_simbench.report.markdown import run as markdown
from pytest_simbench.report.model import sweep, truth
from pytest_simbench.report.model.summary import TaskSummary, summarise

DRAWN = "free motion"
"""Whose pictures are on the page."""
READING = ("value", "exact", "tolerance")
COLUMNS = (
    "profile", "simulator", "version", "timestep", "phenomenon", "law", "status", *READING,
    "error", "ratio", "unit", "cpu", "simulated",
)  # fmt: skip
BY_NAME = {law.name: law for law in LAWS}
METRICS = {name: law.metrics for name, law in BY_NAME.items()}


def _told(swept: bool, record: Record) -> Mapping[str, object] | None:
    if PHENOMENON not in record.settings or (record.swept and not swept):
        return None
    return {
        "timestep": str(record.settings["timestep"]),
        "phenomenon": record.settings[PHENOMENON],
        "law": record.task,
        "unit": BY_NAME[record.task].unit,
        **{name: getattr(record.notes.reading, name, None) for name in READING},
        **{name: record.metrics.get(name) for name in ("error", "ratio")},
        **{name: record.stepping.get(name) for name in ("cpu", "simulated", "steps")},
        "own": record.notes.own_timestep,
        "message": " ".join(record.error.message.split()) if record.error else "",
    }


KEY = ("profile", "simulator", "law")
TRUTH = Kept("truth", KEY, COLUMNS, partial(_told, False))
SWEEP = Kept(
    "sweep", (*KEY, "timestep"), (*COLUMNS, "own", "steps", "message"), partial(_told, True)
)


def found_sweeps() -> list[Swept]:
    """What sweep.csv tells, laws in their order."""
    return sweeps([_record_of_sweep(line) for line in _in_order(SWEEP.lines())], METRICS)


def _in_order(lines: list[Line]) -> list[Line]:
    order = list(BY_NAME)
    return sorted(lines, key=lambda line: order.index(line["law"]))


def _record_of_sweep(line: Line) -> Record:
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
            path = DOCS / "pictures" / f"sweep_{DRAWN.replace(' ', '_')}_{over}.png"
            figures.draw(found, DRAWN, over).savefig(path, dpi=90)


def summaries(profile: str) -> list[TaskSummary]:
    """What truth.csv tells of one profile, laws in their order."""
    return summarise([_record(line) for line in _in_order(TRUTH.lines(profile=profile))], METRICS)


def _record(line: Line) -> Record:
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


def phenomena(profile: str) -> str:
    """Simulators by phenomena."""
    return markdown.table(truth.table(summaries(profile)))


def unbeaten(profile: str) -> str:
    """A sentence for each phenomenon."""
    return "\n".join(f"- {text}" for text in truth.sentences(summaries(profile)))


def over_steps(part: str) -> str:
    """One table of laws over time steps: `steps`, `broken` or `failures`."""
    found = found_sweeps()
    if part == "steps":
        return markdown.table(sweep.table(found))
    tables = {each.title: each.columns for each in sweep.details(found)}
    if part == "broken":
        return markdown.table(tables[sweep.BROKEN])
    failed = [table for title, table in tables.items() if title.startswith("what failed")]
    return "\n".join(map(markdown.table, failed)) or "Nothing failed."


def every_law() -> str:
    """A page: every law in the words of its docstring."""
    rows = []
    for law in LAWS:
        told = " ".join((type(law).__doc__ or "").split())
        unit = f" [{law.unit}]" if law.unit else ""
        cells = (law.name, law.phenomenon, law.quantity + unit, told)
        rows.append([for_markdown(cell, cell=True) for cell in cells])
    heads = ("law", "phenomenon", "what is measured", "what is right, and the tolerance")
    return f"# The {len(LAWS)} laws\n\n{table(heads, rows, len(heads))}\n"


def every_error() -> str:
    """A page: what each simulator makes of each law."""
    parts = [
        "# Every law's error\n\nIn the law's own unit. In brackets stands the number of tolerances"
        ", where the law is not kept.\nValue, exact value and tolerance: [truth.csv](truth.csv)."
    ]
    for profile in ("tuned", "default"):
        parts += [f"## Settings: {profile}", unbeaten(profile)]
        for each in truth.details(summaries(profile)):
            parts.append(
                f"### {each.title.capitalize()}, {profile}\n\n{markdown.table(each.columns)}"
            )
    return "\n\n".join(parts) + "\n"


def every_step() -> str:
    """A page: orders of convergence and cheapest steps."""
    parts = [
        "# Laws over time steps\n\n    pytest suites/test_physics.py --sim=all --sim-sweep "
        "--protocol=smoke\n\nTuned settings, six time steps each. What it says: [which step to "
        "take](../truth.md#which-step-to-take).\nEvery number: [sweep.csv](sweep.csv)."
    ]
    for each in sweep.details(found_sweeps()):
        if each.title.partition(":")[0] in PHENOMENA:
            title = each.title[0].upper() + each.title[1:]
            parts.append(f"{title}:\n\n{markdown.table(each.columns)}")
    return "\n\n".join(parts) + "\n"
