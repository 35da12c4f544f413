"""Laws over time steps: orders of convergence, and the cheapest step."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from pytest_simbench.measure.convergence import Convergence
from pytest_simbench.measure.sweep import REFERENCE, Point, StepChoice, SweepLine, Swept, choice
from pytest_simbench.records.phenomena import ordered
from pytest_simbench.records.series import step_text
from pytest_simbench.report.model import cells
from pytest_simbench.report.model.document import Column, Content, Section, Table, capital, names

TITLE = "the same laws over time steps"

LEGEND = (
    f"10/10 2ms 0.011: with steps of 2 ms 10 of 10 laws have an error that a step of "
    f"{1e3 * REFERENCE:g} ms may cost, at 0.011 CPU seconds for a simulated second; no other step "
    "keeps more, and none that keeps as many is cheaper"
)

READING = (
    "Order: the slope of the error over the step, both logarithmic, with its 95 % interval; 1 is "
    "what an integrator of the first order has, 0 says that the step does not matter. Exact: every "
    "error is 0. Rounding: nearly all are as small as single precision may add up to."
)

BROKEN = f"laws that no step keeps with the error that {1e3 * REFERENCE:g} ms may cost"
FAILED = "what failed at a time step"
"""Titles of tables."""

Who = tuple[str, str, str, int]


def section(found: Sequence[Swept]) -> Section | None:
    """All that is told of them; None without any."""
    if not found:
        return None
    return Section(capital(TITLE), (), [Table(TITLE, table(found), LEGEND), *details(found)])


def table(found: Sequence[Swept]) -> list[Column]:
    """Simulators by phenomena: the step to take."""
    known = labels(found)
    columns = [Column("simulator", known.values(), left=True)]
    for phenomenon in phenomena(found):
        of = [law for law in found if law.phenomenon == phenomenon]
        columns.append(Column(phenomenon, [_choice(choice(of, who)) for who in known]))
    return columns


def details(found: Sequence[Swept]) -> list[Table]:
    """For each phenomenon its laws by simulators: the order, the cheapest step that keeps the law
    with its own tolerance, and with that of `REFERENCE`; then what no step helps, and what failed.
    """
    kinds: dict[str, Callable[[Swept, SweepLine], Content]] = {
        "order of convergence": lambda law, line: _order(line.order),
        "cheapest step that keeps the law, CPU s/sim s": lambda law, line: _step(
            line.cheapest_kept
        ),
        f"cheapest step with the error that {1e3 * REFERENCE:g} ms may cost, CPU s/sim s": (
            lambda law, line: _step(line.cheapest_within(law.allowed))
        ),
    }
    tables: list[Table] = []
    for phenomenon in phenomena(found):
        laws = [law for law in found if law.phenomenon == phenomenon]
        for title, content in kinds.items():
            columns = [Column("law", [law.law for law in laws], left=True)]
            for who, name in labels(laws).items():
                lines = [next((n for n in law.lines if n.who == who), None) for law in laws]
                shown = [
                    cells.MISSING if line is None else content(law, line)
                    for law, line in zip(laws, lines, strict=True)
                ]
                columns.append(Column(name, shown))
            note = "" if tables else READING
            tables.append(Table(f"{phenomenon}: {title}", columns, note))
    for title, headings, rows in (
        (BROKEN, ("simulator", "laws"), broken(found)),
        (FAILED, ("simulator", "law", "steps", "message"), failures(found)),
    ):
        if rows:
            columns = [
                Column(heading, [row[k] for row in rows], left=True, wrap=heading == headings[-1])
                for k, heading in enumerate(headings)
            ]
            tables.append(Table(title, columns))
    return tables


def broken(found: Sequence[Swept]) -> list[tuple[str, str]]:
    """The laws that a simulator keeps at none of its steps, held against the error that `REFERENCE`
    may cost: no smaller step helps there."""
    told = []
    for who, name in labels(found).items():
        lines = [(law, line) for law in found for line in law.lines if line.who == who]
        laws = [
            law.law
            for law, line in lines
            if not math.isnan(law.allowed) and line.cheapest_within(law.allowed) is None
        ]
        if laws:
            told.append((name, ", ".join(laws)))
    return told


def failures(found: Sequence[Swept]) -> list[tuple[str, str, str, str]]:
    """What a simulator could not do: its name, the law, at which steps, and the first message."""
    known = labels(found)
    told = []
    for law in found:
        for line in law.lines:
            failed = [point for point in line.points if math.isinf(point.error)]
            if failed:
                steps = ", ".join(step_text(point.step) for point in failed)
                told.append((known[line.who], law.law, steps, failed[0].message))
    return told


def phenomena(found: Sequence[Swept]) -> list[str]:
    """Those that there are, in the order of tables."""
    return ordered(law.phenomenon for law in found)


def labels(found: Sequence[Swept]) -> dict[Who, str]:
    """Short names of the configurations."""
    every = sorted({line.who for law in found for line in law.lines})
    places = [(*who[:3], f"settings {who[3]}" if who[3] > 1 else "") for who in every]
    return dict(zip(every, names(places), strict=True))


def _choice(found: StepChoice | None) -> list[str]:
    if found is None:
        return [cells.MISSING]
    kept = f"{found.kept}/{found.laws}"
    if not found.kept:
        return [kept]
    step, *cost = _step(found)
    return [f"{kept} {step}", *cost]


def _step(found: Point | StepChoice | None) -> list[str]:
    """A step and, where it is known, its cost."""
    if found is None:
        return ["none"]
    return [step_text(found.step), *([] if found.cost is None else [cells.number(found.cost, 2)])]


def _order(found: Convergence) -> str:
    if found.kind != "order":
        return found.kind if found.kind != "unknown" else cells.MISSING
    order, *ends = map(cells.two_decimals, (found.order, found.low, found.high))
    return f"{order} [{', '.join(ends)}]" if math.isfinite(found.low) else order
