"""Tables of the contact tasks, from docs/data/contact.csv."""

from __future__ import annotations

from statistics import fmean

from tables import NAMES, Kept, Line, numbers, table

from pytest_simbench.records.metrics import Metric, significant
from pytest_simbench.records.record import Record
from pytest_simbench.tasks import (
    Carrying,
    Inserting,
    Nesting,
    Opening,
    Oversized,
    Pouring,
    Slipping,
    Task,
)

CASES: dict[Task, tuple[str, ...]] = {
    Carrying(): ("shape",),
    Slipping(): ("shape",),
    Inserting(): ("section", "clearance"),
    Oversized(): ("section", "clearance"),
    Pouring(): ("balls",),
    Nesting(): ("bowls",),
    Opening(): ("friction",),
}
"""The parameters by which the repetitions of a task differ."""

TASKS = {task.name: task for task in CASES}
METRICS = {metric.name: metric for task in TASKS.values() for metric in task.metrics}
COSTS = ("cpu_cost", "ram_peak")


def _told(record: Record) -> dict[str, object] | None:
    if record.task not in TASKS or record.robot.get("name", "panda") != "panda":
        return None
    given = [record.settings[f"task.{name}"] for name in CASES[TASKS[record.task]]]
    case = " ".join(f"{one:g}" if isinstance(one, float) else str(one) for one in given)
    return {"case": case, **record.metrics, **{name: record.cost(name) for name in COSTS}}


CONTACT = Kept(
    "contact",
    ("task", "case", "profile", "simulator", "seed"),
    ("task", "case", "profile", "simulator", "version", "seed", "status", *METRICS, *COSTS),
    _told,
)


def contact(task: str, profile: str, part: str = "") -> str:
    """A row for each simulator; in a cell the means of all cases, or of those of one part. A
    crashed repetition counts where yes or no is counted."""
    lines = [n for n in CONTACT.lines(task=task, profile=profile) if n["case"].startswith(part)]
    cases = list(dict.fromkeys(line["case"] for line in lines))
    metrics = [m for m in TASKS[task].metrics if any(line[m.name] for line in lines)]
    rows = []
    for simulator, name in NAMES.items():
        of = [line for line in lines if line["simulator"] == simulator]
        if of:
            each = [[line for line in of if line["case"] == case] for case in cases]
            crashed = sum(line["status"] == "failed" for line in of)
            cost = significant(fmean(numbers(of, "cpu_cost") or [0.0]))
            cells = (_cell(each, metric) for metric in metrics)
            rows.append([name, f"{crashed} of {len(of)}", *cells, cost])
    heads = [f"{metric.title} {metric.unit}".strip() for metric in metrics]
    return table(("simulator", "crashed", *heads, "CPU s per s"), rows)


def _cell(each: list[list[Line]], metric: Metric) -> str:
    if metric.kind == "yes_no":
        asked = [[n for n in lines if n["status"] != "ok" or n[metric.name]] for lines in each]
        found = [(sum(numbers(lines, metric.name)), len(lines)) for lines in asked if lines]
        found = found if len({*found}) > 1 else [(len(found) * found[0][0], sum(map(len, asked)))]
        return " / ".join(f"{yes:g} of {n}" for yes, n in found)
    means = [fmean(found) if (found := numbers(lines, metric.name)) else None for lines in each]
    return " / ".join("-" if mean is None else significant(round(mean, 3), 2) for mean in means)
