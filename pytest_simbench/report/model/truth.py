"""What simulators make of laws: the table of phenomena, a sentence for each, and every law's
error."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean

from pytest_simbench.measure.phenomena import KEPT, Miss, Misses, PhenomenonVerdict, verdict, worst
from pytest_simbench.records.metrics import significant
from pytest_simbench.records.phenomena import ordered
from pytest_simbench.records.series import grouped
from pytest_simbench.report.model import cells
from pytest_simbench.report.model.answer import NAMED
from pytest_simbench.report.model.document import Column, Section, Table, capital, listed
from pytest_simbench.report.model.summary import Row, TaskSummary, short_labels

TITLE = "which simulator is right about what"

CHEAPER = 0.5
"""Who costs at most so much of the next one is called the cheapest: times are of one run on a
machine that may be busy."""

LEAST_SHOWN = 0.001
"""A smaller share of a tolerance is not told in digits."""

LEGEND = (
    "7/8 12x: 7 of 8 laws are kept, and the worst is missed by 12 times its tolerance, which is "
    "what a time step may cost an integrator of the first order; fails: a repetition failed or its "
    "world diverged"
)


def laws(summaries: Sequence[TaskSummary]) -> list[TaskSummary]:
    """Those of laws."""
    return [summary for summary in summaries if summary.phenomenon]


def others(summaries: Sequence[TaskSummary]) -> list[TaskSummary]:
    """Those of everything else."""
    return [summary for summary in summaries if not summary.phenomenon]


def section(summaries: Sequence[TaskSummary]) -> Section | None:
    """All that is told of laws; None without any."""
    if not laws(summaries):
        return None
    first = Table(TITLE, table(summaries), LEGEND)
    return Section(capital(TITLE), sentences(summaries), [first, *details(summaries)])


def sentences(summaries: Sequence[TaskSummary]) -> list[str]:
    """A verdict on each phenomenon and settings profile, in words; none of a single simulator."""
    every, found = contenders(summaries), []
    profiles = list(dict.fromkeys(one.profile for one in every))
    for phenomenon, of in _by_phenomenon(summaries).items():
        for profile in profiles:
            compared = {one.name: one for one in contenders(summaries, profile) if one.misses(of)}
            if len(compared) > 1:
                misses = {name: one.misses(of) for name, one in compared.items()}
                costs = {name: one.cost(of) for name, one in compared.items()}
                where = f" ({profile})" if len(profiles) > 1 else ""
                found.append(f"for {phenomenon}{where}: {_told(verdict(misses), costs)}")
    return found


def table(summaries: Sequence[TaskSummary]) -> list[Column]:
    """Simulators by phenomena, and what a simulated second costs."""
    every = contenders(summaries)
    costs = [one.cost(laws(summaries)) for one in every]
    return [
        Column("simulator", [one.name for one in every], left=True),
        *(
            Column(phenomenon, [_cell(one.misses(of)) for one in every])
            for phenomenon, of in _by_phenomenon(summaries).items()
        ),
        Column("CPU s/sim s", [cells.MISSING if c is None else cells.number(c, 2) for c in costs]),
    ]


def details(summaries: Sequence[TaskSummary]) -> list[Table]:
    """For each phenomenon its laws by simulators: the error in the law's unit, with its ratio to
    the tolerance where the law is not kept."""
    found = []
    for phenomenon, of in _by_phenomenon(summaries).items():
        columns = [
            Column("law", [law.task for law in of], left=True),
            Column("error in", map(_unit, of), left=True),
        ]
        for one in contenders(summaries):
            columns.append(Column(one.name, [_error(one.rows.get(law.task)) for law in of]))
        found.append(Table(f"laws of {phenomenon}", columns))
    return found


@dataclass(frozen=True)
class Contender:
    """A simulator in one mode and settings profile, with its row of each law."""

    name: str
    profile: str
    rows: Mapping[str, Row]

    def misses(self, of: Sequence[TaskSummary]) -> Misses:
        """Of these laws those that it was asked."""
        found = {law.task: _miss(self.rows[law.task]) for law in of if law.task in self.rows}
        return {law: miss for law, miss in found.items() if miss is not None}

    def cost(self, of: Sequence[TaskSummary]) -> float | None:
        """CPU seconds for a simulated second, the mean of these laws."""
        rows = [self.rows[law.task] for law in of if law.task in self.rows]
        known = [cost.mean for row in rows if (cost := row.costs.get("cpu_cost")) is not None]
        return fmean(known) if known else None


def contenders(summaries: Sequence[TaskSummary], profile: str | None = None) -> list[Contender]:
    """Those of one settings profile, or of all, with short names."""
    found: dict[str, dict[str, Row]] = {}
    for law in laws(summaries):
        for row in law.rows:
            if profile in (None, row.profile):
                found.setdefault(row.label, {}).setdefault(law.task, row)
    rows = sorted(found.values(), key=lambda of: next(iter(of.values())).profile)
    firsts = [next(iter(of.values())) for of in rows]
    return [
        Contender(name, first.profile, of)
        for name, first, of in zip(short_labels(firsts), firsts, rows, strict=True)
    ]


def _by_phenomenon(summaries: Sequence[TaskSummary]) -> dict[str, list[TaskSummary]]:
    found = grouped(laws(summaries), lambda law: law.phenomenon)
    return {phenomenon: found[phenomenon] for phenomenon in ordered(found)}


def _miss(row: Row) -> Miss | None:
    if row.failed:
        return Miss(math.inf, math.inf)
    ratio, error = row.metrics.get("ratio"), row.metrics.get("error")
    return None if ratio is None else Miss(ratio.max, error.max if error else math.inf)


def _cell(misses: Misses) -> str:
    if not misses:
        return cells.MISSING
    kept = sum(miss.ratio <= KEPT for miss in misses.values())
    return f"{kept}/{len(misses)} {_times(worst(misses))}"


def _times(ratio: float) -> str:
    if 0 < ratio < LEAST_SHOWN:
        return f"<{LEAST_SHOWN:g}x"
    return "fails" if math.isinf(ratio) else f"{significant(ratio, 2)}x"


def _error(row: Row | None) -> str:
    miss = _miss(row) if row else None
    if miss is None:
        return cells.MISSING
    if math.isinf(miss.error):
        return "fails"
    return f"{miss.error:.2g}" + (f" ({_times(miss.ratio)})" if miss.ratio > KEPT else "")


def _unit(summary: TaskSummary) -> str:
    return next((metric.unit for metric in summary.metrics if metric.name == "error"), "")


def _told(found: PhenomenonVerdict, costs: Mapping[str, float | None]) -> str:
    if found.best is not None:
        text = f"{found.best}, which keeps {found.kept[found.best]} of {found.laws} laws"
    else:
        some = [f"{who} {found.kept[who]}" for who in found.unbeaten[:NAMED]]
        more = len(found.unbeaten) - len(some)
        some += [f"{more} more"] * (more > 0)
        text = f"no clear best; laws kept of {found.laws} by those that nobody beats: "
        text += listed(some) or "nobody"
        known = sorted((c, who) for who in found.unbeaten if (c := costs[who]) is not None)
        if len(known) > 1 and known[0][0] <= CHEAPER * known[1][0]:
            text += f"; the cheapest of them: {known[0][1]}"
    left = f"; not compared: {listed(found.incomplete)}" if found.incomplete else ""
    return f"{text}{left}."
