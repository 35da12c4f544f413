"""What changed since a baseline."""

from __future__ import annotations

from collections.abc import Sequence

from pytest_simbench.measure.change import Change
from pytest_simbench.measure.gate import GateReport
from pytest_simbench.records.metrics import CRASHED
from pytest_simbench.records.series import short
from pytest_simbench.report.model.document import Column, Section, Table

ALWAYS = ("rtf", "cpu_cost", "ram")
"""Costs that are shown although they may not have changed, as the study's metrics are."""

UNCLEAR = "no clear change"
PASSED = "no metric got worse beyond its limit"
NO_LIMIT = "not significantly more repetitions crashed; no other limit was tested"


def columns(report: GateReport) -> list[Column]:
    """One line for each metric with a limit, each of the study's, each outcome that changed, and
    each cost that clearly did."""
    rows = _rows(report)
    if not rows:
        return []
    found = [change for change, _ in rows]
    return [
        Column("test", _tests(found), left=True, above=True),
        Column("metric", map(_name, found), left=True),
        Column("baseline", [_value(change, change.comparison.first) for change in found]),
        Column("now", [_value(change, change.comparison.second) for change in found]),
        Column("change", map(_amount, found)),
        Column("p", [f"{change.p_value:.2g}" for change in found]),
        Column("verdict", [verdict for _, verdict in rows], left=True, wrap=True),
    ]


def _rows(report: GateReport) -> list[tuple[Change, str]]:
    """Changes with their verdicts: by test, those with a limit first."""
    found = [
        (change, _limited(change))
        for change in report.changes
        if change.metric != CRASHED or change.comparison.first or change.comparison.second
    ]
    found += [
        (change, _free(change))
        for change in report.others
        if _free(change) != UNCLEAR
        or change.visible
        or change.metric.study
        or change.metric.name in ALWAYS
    ]
    tests = list(dict.fromkeys(change.test for change, _ in found))
    return sorted(found, key=lambda row: tests.index(row[0].test))


def _tests(changes: Sequence[Change]) -> list[str]:
    """Their tests, without file and class where that leaves all apart."""
    shown = {change.test: short(change.test) for change in changes}
    alone = len({*shown.values()}) == len(shown)
    return [shown[change.test] if alone else change.test for change in changes]


def _limited(change: Change) -> str:
    limit = change.limit.describe(change.metric, change.limit.amount)
    if change.exceeded:
        return f"FAILED, limit {limit}"
    if change.beyond:
        return f"may be chance, limit {limit}"
    return f"passed, limit {limit}"


def _free(change: Change) -> str:
    means = change.comparison.first, change.comparison.second
    if not (change.significant and change.metric.differs(*means)):
        return UNCLEAR
    return "worse" if change.loss > 0 else "better"


def _name(change: Change) -> str:
    return f"{change.metric.name} (speed out)" if change.normalised else change.metric.name


def _value(change: Change, value: float) -> str:
    """CPU is told in % alone: that it is of one core would make the table too wide."""
    return change.metric.format(value).replace(" of a core", "")


def _amount(change: Change) -> str:
    """The change of the number itself, with its sign: `-20 points`, `+3.2 %`."""
    rising = change.comparison.second > change.comparison.first
    text = change.limit.describe(change.metric, abs(change.loss))
    return f"{'+' if rising else '-'}{text}" if change.loss else "0"


def section(name: str, report: GateReport, limited: bool = True) -> Section:
    """The whole comparison with the baseline of that name. Where limits were given, passing is
    worth a sentence."""
    verdicts = [f"FAILED {sentence}" for sentence in report.failures]
    verdicts += [passed(report)] * (limited and not verdicts)
    warned = [f"{DIFFERENT}: {sentence}" for sentence in report.differences]
    found = columns(report)
    shown = [Table("Changes", found)] if found else []
    notes = [f"not compared: {sentence}" for sentence in report.notes]
    return Section(f"Compared with {name}", [*verdicts, *warned], shown, notes)


DIFFERENT = "different in the baseline (a change may come from this)"


def passed(report: GateReport) -> str:
    """What is said when nothing fails; empty where something does."""
    if report.failures:
        return ""
    if chance := sum(change.beyond for change in report.changes):
        return f"{PASSED} for sure; {chance} did, perhaps by chance"
    return PASSED if report.compared else NO_LIMIT
