"""Pass or fail, and why: what the terminal, the page, `report.md` and a CI comment open with."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite

from pytest_simbench.measure.gate import GateReport
from pytest_simbench.measure.limits import CRASHED
from pytest_simbench.records.claims import Claim
from pytest_simbench.records.folder import Reading
from pytest_simbench.records.metrics import COSTS, Metric, significant
from pytest_simbench.records.record import Record
from pytest_simbench.records.series import grouped
from pytest_simbench.report.model.again import command
from pytest_simbench.report.model.document import Column, Table, names

MOST = 12
"""Claims that fail, or are not decided, which the first screen tells in full."""

ORDER = ("FAIL", "UNDECIDED", "PASS")

Metrics = Mapping[str, Sequence[Metric]]
"""What each task declares."""

NO_CLAIM = "no claim was made"


@dataclass(frozen=True)
class Trouble:
    """A claim that failed or is not decided.

    Attributes:
        what: simulator, test, and what came of the claim.
        worst: which repetition to look at, in words; empty where none stands out.
        again: the command that runs it again, or more of them; may be empty.
        record: that repetition.
    """

    what: str
    worst: str = ""
    again: str = ""
    record: Record | None = None


@dataclass(frozen=True)
class Claims:
    """The claims of a run, ready to be drawn.

    Attributes:
        state: the worst verdict; empty where no claim was made.
        sentence: the first line of every report.
        table: a row for each test and claim, a column for each simulator.
        troubles: what failed, then what is not decided.
        more: how many troubles are left out.
    """

    state: str
    sentence: str
    table: Table
    troubles: Sequence[Trouble]
    more: int = 0


def claims_of(reading: Reading, comparison: GateReport | None = None) -> Claims:
    """Of a run, with the limits against its baseline."""
    claims = _that_count(reading.claims)
    failures = comparison.failures if comparison else ()
    count = Counter[str](claim.verdict for claim in claims)
    count["FAIL"] += len(failures)
    state = next((verdict for verdict in ORDER if count[verdict]), "")
    troubles = [Trouble(text) for text in failures]
    bad = sorted(
        (claim for claim in claims if claim.verdict != "PASS"), key=lambda c: ORDER.index(c.verdict)
    )
    of_test = grouped(reading.records, lambda r: r.test)
    fails = [claim for claim in bad if claim.verdict == "FAIL"]
    open_ = grouped(
        bad[len(fails) :], lambda c: (_subject(c, claims), _claimed(c, reading.metrics))
    )
    troubles += [_trouble(c, of_test.get(c.test, []), reading.metrics) for c in fails]
    troubles += [_undecided(*of, group, reading.metrics) for of, group in open_.items()]
    troubles, more = troubles[:MOST], len(troubles) - MOST
    told = _sentence(state, count, reading.records)
    return Claims(state, told, _table(claims, reading.metrics), troubles, max(0, more))


def _that_count(found: Sequence[Claim]) -> list[Claim]:
    """The last of each; of a test as a whole, only that it failed and no claim of it says why."""
    last = {claim.identity: claim for claim in found}.values()
    failed = {claim.test for claim in last if claim.metric and claim.verdict == "FAIL"}
    return [
        claim
        for claim in last
        if claim.metric or (claim.verdict == "FAIL" and claim.test not in failed)
    ]


def _sentence(state: str, count: Counter[str], records: Sequence[Record]) -> str:
    ended = [record for record in records if record.status != "interrupted"]
    crashed = sum(record.status == "failed" for record in ended)
    cut = len(records) - len(ended)
    repetitions = f"{crashed} of {len(ended)} repetitions crashed" + f", {cut} cut short" * bool(
        cut
    )
    if not state:
        return f"{NO_CLAIM}; {repetitions}"
    total = sum(count.values())
    parts = [f"{count['FAIL']} of {total} claims fail" if count["FAIL"] else f"{total} claims"]
    if not count["FAIL"]:
        parts = [f"{count['PASS']} of {total} claims hold"]
    if count["UNDECIDED"]:
        parts.append(f"{count['UNDECIDED']} undecided")
    return f"{state}   {', '.join(parts)}; {repetitions}"


def _table(claims: Sequence[Claim], metrics: Metrics) -> Table:
    """A row for each function, task and claim; several tests in one cell are counted."""
    if not claims:
        return Table("Claims", [])
    places = list(dict.fromkeys(map(_place, claims)))
    who = dict(zip(places, names(places, "{} {}", " "), strict=True))
    rows = grouped(claims, lambda c: (_subject(c, claims), _claimed(c, metrics)))
    found = [Column("claim", [f"{subject}: {text}" for subject, text in rows], left=True)]
    for name in dict.fromkeys(who.values()):
        of = ([c for c in row if who[_place(c)] == name] for row in rows.values())
        found.append(Column(name, [_cell(row, metrics) for row in of], left=True))
    return Table("Claims", found)


def _place(claim: Claim) -> tuple[str, str, str]:
    return claim.simulator, claim.mode, claim.profile


def _subject(claim: Claim, claims: Sequence[Claim]) -> str:
    """The test's function and its variant; of many variants (laws) the function alone."""
    name = claim.function.rpartition("::")[2]
    variants = {c.variant for c in claims if c.function == claim.function}
    return f"{name} {claim.variant}".rstrip() if len(variants) <= MOST // 3 else name


def _claimed(claim: Claim, metrics: Metrics) -> str:
    """The claim in words: `placed >= 90 %`."""
    if not claim.metric or claim.threshold is None:
        return "the test passes"
    sign = ">=" if claim.relation == "at least" else "<="
    metric = _metric(claim, metrics)
    shown = metric.format(claim.threshold) if metric else significant(claim.threshold)
    return f"{claim.metric} {sign} {shown}"


def _metric(claim: Claim, metrics: Metrics) -> Metric | None:
    known = (*metrics.get(claim.task, ()), *COSTS, CRASHED)
    return next((metric for metric in known if metric.name == claim.metric), None)


def _cell(claims: Sequence[Claim], metrics: Metrics) -> str:
    """Verdict and value; of several claims how many have each verdict."""
    if len(claims) != 1:
        count = Counter[str](claim.verdict for claim in claims)
        return ", ".join(f"{verdict} {count[verdict]}" for verdict in ORDER if count[verdict])
    return f"{claims[0].verdict} {_value(claims[0], metrics)}".rstrip()


def _value(claim: Claim, metrics: Metrics) -> str:
    """What was measured, with its bounds: `71 [60, 80]`, `4 of 5`."""
    metric = _metric(claim, metrics)
    if metric is None or claim.mean is None:
        return ""
    if metric.kind == "yes_no":
        return f"{round(claim.mean * claim.n)} of {claim.n}"
    scale = 100 if metric.bounded else 1
    ends = [
        significant(scale * end)
        for end in (claim.low, claim.high)
        if end is not None and isfinite(end)
    ]
    bounds = f" [{', '.join(ends)}]" if len(ends) == 2 and ends[0] != ends[1] else ""
    return f"{significant(scale * claim.mean)}{bounds}"


def _trouble(claim: Claim, records: Sequence[Record], metrics: Metrics) -> Trouble:
    crashed = f", {claim.crashed} crashed" if claim.crashed else ""
    name = claim.function.rpartition("::")[2]
    test = f"{claim.simulator}, {f'{name} {claim.variant}'.rstrip()}"
    if not claim.metric:
        record = next((r for r in records if r.status == "failed"), None) or next(
            iter(records), None
        )
        return Trouble(f"{claim.verdict} {test}: {claim.advice}", "", _again(record), record)
    worst = _worst(claim, [r for r in records if r.task == claim.task], metrics)
    value = f"{_value(claim, metrics)} over {claim.n} repetitions{crashed}"
    what = f"{claim.verdict} {test}: {_claimed(claim, metrics)} is {value}"
    if worst is None:
        return Trouble(what)
    error = worst.error
    why = f"crashed: {error.cause}" if error else _told(worst, _metric(claim, metrics))
    return Trouble(
        what, f"seed {worst.seed}, repetition {worst.repetition} {why}", _again(worst), worst
    )


def _undecided(subject: str, claimed: str, claims: Sequence[Claim], metrics: Metrics) -> Trouble:
    """One claim of several simulators that are not decided."""
    found = [f"{claim.simulator} {_value(claim, metrics)} ({claim.advice})" for claim in claims]
    return Trouble(f"UNDECIDED {subject}: {claimed}: {'; '.join(found)}")


def _told(record: Record, metric: Metric | None) -> str:
    value = record.value(metric) if metric else None
    return "" if metric is None or value is None else f"has {metric.format(value)}"


def _again(record: Record | None) -> str:
    return command(record) if record else ""


def _worst(claim: Claim, records: Sequence[Record], metrics: Metrics) -> Record | None:
    """The repetition that speaks most against a claim; a crashed one first."""
    metric = _metric(claim, metrics)
    crashed = [record for record in records if record.status == "failed"]
    if crashed or metric is None:
        return next(iter(crashed), None)
    known = [(value, r) for r in records if (value := r.value(metric)) is not None]
    if not known:
        return None
    pick = min if claim.relation == "at least" else max
    return pick(known, key=lambda pair: pair[0])[1]
