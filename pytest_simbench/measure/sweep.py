"""Laws over time steps: the order of convergence, and what each error costs (work-precision).

A sweep is any run, or runs that were merged, with two or more time steps of a simulator at a law;
`--sim-sweep` only chooses them. Lines of different settings are never pooled: what must be equal is
everything but the step.

Tolerances grow with the step, and costs fall with it, so at its own tolerance a law is cheapest at
the longest step. To compare what the same accuracy costs, all are held against one error besides:
the law's tolerance at `REFERENCE`, whatever their step."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import fmean

import numpy as np

from pytest_simbench.measure.convergence import Convergence, convergence
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.phenomena import PHENOMENON
from pytest_simbench.records.readings import rounding
from pytest_simbench.records.record import Record
from pytest_simbench.records.series import RowKey, configurations, grouped

REFERENCE = 1e-3
"""[s]. An accuracy is that which this step may cost."""

PERCENT = 200.0
"""What rounding counts for where the error is a share of an energy or a momentum, a product of two
numbers that are rounded."""


@dataclass(frozen=True)
class Point:
    """A law at one time step.

    Attributes:
        step: [s].
        error: the worst of the repetitions, in the law's unit; infinite where one failed.
        tolerance: of the law at that step; None where a repetition failed.
        cost: CPU seconds for a simulated second, the mean; None where it is not known.
        rounding: what single precision, in which several engines compute, may make of the error,
            in its unit, as laws allow for it.
        message: why it failed, in one line.
    """

    step: float
    error: float
    tolerance: float | None
    cost: float | None
    rounding: float = 0.0
    message: str = ""


@dataclass(frozen=True)
class SweepLine:
    """One configuration of one simulator at a law.

    Attributes:
        who: simulator, mode, profile, and which of several such tests or configurations, from 1.
        points: the longest step first.
        order: of the error's convergence.
    """

    who: tuple[str, str, str, int]
    points: tuple[Point, ...]
    order: Convergence

    @property
    def cheapest_kept(self) -> Point | None:
        """Of the steps at which the law is kept, with the tolerance of each, the cheapest."""
        return _cheapest([p for p in self.points if p.error <= (p.tolerance or 0.0)])

    def cheapest_within(self, error: float) -> Point | None:
        """Of the steps with at most that error the cheapest."""
        return _cheapest([point for point in self.points if point.error <= error])


@dataclass(frozen=True)
class Swept:
    """A law over time steps.

    Attributes:
        unit: of its error.
        lines: of the simulators, in the order of tables.
        tolerances: of the law by step [s], the same for everybody.
        allowed: the tolerance at `REFERENCE`; nan where the steps do not reach around it.
    """

    law: str
    phenomenon: str
    unit: str
    lines: tuple[SweepLine, ...]
    tolerances: Mapping[float, float]
    allowed: float


@dataclass(frozen=True)
class StepChoice:
    """The step [s] to take for a phenomenon: how many of its laws are kept with an error that
    `REFERENCE` may cost, at CPU seconds for a simulated second, the mean over the laws."""

    step: float
    kept: int
    laws: int
    cost: float | None


def sweeps(records: Iterable[Record], metrics: Mapping[str, Sequence[Metric]]) -> list[Swept]:
    """Every law of a run of which a simulator has two time steps or more, in order of appearance;
    the metrics of each task tell the unit."""
    ended = (r for r in records if PHENOMENON in r.settings and r.status != "interrupted")
    found = []
    for law, of_law in grouped(ended, lambda r: r.task).items():
        unit = next((m.unit for m in metrics.get(law, ()) if m.name == "error"), "")
        lines = [line for line in _lines(of_law, unit) if len(line.points) > 1]
        if lines:
            known = {
                p.step: p.tolerance
                for line in lines
                for p in line.points
                if p.tolerance is not None
            }
            phenomenon = str(of_law[0].settings[PHENOMENON])
            found.append(
                Swept(law, phenomenon, unit, tuple(lines), known, tolerance_at(REFERENCE, known))
            )
    return found


def tolerance_at(step: float, known: Mapping[float, float]) -> float:
    """A law's tolerance at any step [s] between those known, a straight line in the logarithms;
    nan beyond them."""
    if not known or not min(known) <= step <= max(known):
        return math.nan
    steps = sorted(known)
    logs = [math.log(known[each]) for each in steps]
    return float(math.exp(np.interp(math.log(step), np.log(steps), logs)))


def choice(laws: Sequence[Swept], who: tuple[str, str, str, int]) -> StepChoice | None:
    """The step at which a simulator keeps most of a phenomenon's laws as well as `REFERENCE` may;
    of several such steps the cheapest. None where it did none of them."""
    at: dict[float, list[tuple[Point, float]]] = {}
    asked = 0
    for law in laws:
        for line in (line for line in law.lines if line.who == who):
            asked += not math.isnan(law.allowed)
            for point in line.points:
                at.setdefault(point.step, []).append((point, law.allowed))
    found = []
    for step, points in at.items():
        costs = [point.cost for point, _ in points if point.cost is not None]
        kept = sum(point.error <= allowed for point, allowed in points)
        found.append(StepChoice(step, kept, asked, fmean(costs) if costs else None))
    return min(found, key=lambda c: (-c.kept, _or_infinite(c.cost), -c.step)) if asked else None


def _lines(records: Sequence[Record], unit: str) -> list[SweepLine]:
    """Of one law."""
    ordered = sorted(records, key=lambda r: RowKey.of(r).order)
    found: list[SweepLine] = []
    for key, group in grouped(ordered, lambda r: RowKey.of(r)[:4]).items():
        stepless = [replace(r, settings={**r.settings, "timestep": 0.0}) for r in group]
        origin = {id(copy): record for copy, record in zip(stepless, group, strict=True)}
        for same in configurations(stepless):
            points = _points([origin[id(copy)] for copy in same], unit)
            fine = [point for point in points if math.isfinite(point.error)]
            columns = ([getattr(p, name) for p in fine] for name in ("step", "error", "rounding"))
            number = 1 + sum(line.who[:3] == key[:3] for line in found)
            found.append(SweepLine((*key[:3], number), tuple(points), convergence(*columns)))
    return found


def _points(records: Sequence[Record], unit: str) -> list[Point]:
    """Of one configuration, the longest step first; a record without a step is left out."""
    by_step: dict[float, list[Record]] = {}
    for record in records:
        step = record.settings.get("timestep")
        if isinstance(step, int | float) and step > 0:
            by_step.setdefault(float(step), []).append(record)
    return [_point(step, by_step[step], unit) for step in sorted(by_step, reverse=True)]


def _point(step: float, records: Sequence[Record], unit: str) -> Point:
    costs = [cost for record in records if (cost := record.cost("cpu_cost")) is not None]
    cost = fmean(costs) if costs else None
    errors = [record.metrics.get("error") for record in records if record.ok]
    known = [error for error in errors if error is not None and math.isfinite(error)]
    if len(known) < len(records):
        failure = next((record.error for record in records if record.error), None)
        message = " ".join(failure.message.split()) if failure else ""
        return Point(step, math.inf, None, cost, message=message or "no error was recorded")
    told = [record.notes.reading for record in records if record.notes.reading]
    tolerances = [reading.tolerance for reading in told]
    scale = max([PERCENT if unit == "%" else 1.0, *(abs(reading.exact) for reading in told)])
    many = max(record.stepping.get("steps") or 1.0 for record in records)
    tolerance = max(tolerances, default=None)
    return Point(step, max(known), tolerance, cost, rounding(scale, int(many)))


def _cheapest(points: Sequence[Point]) -> Point | None:
    return min(points, key=lambda p: (_or_infinite(p.cost), -p.step), default=None)


def _or_infinite(cost: float | None) -> float:
    return math.inf if cost is None else cost
