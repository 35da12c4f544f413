"""Pass or fail, and why: what the terminal, the page, `report.md` and a CI comment open with."""

from __future__ import annotations

import os
import shlex
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path

from pytest_simbench.measure.gate import GateReport
from pytest_simbench.records.claims import Claim
from pytest_simbench.records.configuration import task_parameters
from pytest_simbench.records.folder import RunContents
from pytest_simbench.records.metrics import COSTS, CRASHED, Metric, significant
from pytest_simbench.records.record import Record
from pytest_simbench.records.series import grouped
from pytest_simbench.report.model.document import Column, Table, names

MOST = 12
"""Claims that fail, or are not decided, which the first screen tells in full."""

ORDER = ("FAIL", "UNDECIDED", "PASS", "XFAIL")

Metrics = Mapping[str, Sequence[Metric]]
"""What each task declares."""

NO_CLAIM = "no claim was judged"

OPEN = "the run was resumed and did not end: resume it again"

INCOMPLETE = "the run did not end: resume it"

ONE_SIDED = "A claim has one side, and so have its bounds: those of other tables are wider."


@dataclass(frozen=True)
class Trouble:
    """What came of a claim that failed or is not decided; which repetition is the worst, in words,
    and the command that runs it again, which may be empty."""

    what: str
    worst: str = ""
    again: str = ""


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
    more: int

    def seen_from(self, folder: Path, root: Path) -> Claims:
        """With commands for that folder; they are for pytest's root folder."""
        way = os.path.relpath(root, folder)
        if way == os.curdir:
            return self
        found = [(trouble, shlex.split(trouble.again)) for trouble in self.troubles]
        for _, words in found:
            words[1:2] = [os.path.join(way, word) for word in words[1:2]]
        return replace(self, troubles=[replace(t, again=shlex.join(words)) for t, words in found])


@dataclass(frozen=True)
class _Told:
    """A claim with the metric that it is about, None where that is not known, and its subject: the
    test's function and its variant; of many variants (laws) the function alone. `who` is the
    simulator, with mode and profile where a run has several."""

    claim: Claim
    metric: Metric | None
    subject: str
    who: str

    @property
    def claimed(self) -> str:
        """The claim in words: `placed >= 90 %`."""
        claim, metric = self.claim, self.metric
        if not claim.metric or claim.threshold is None:
            return "the test passes"
        sign = ">=" if claim.relation == "at least" else "<="
        shown = metric.format(claim.threshold) if metric else significant(claim.threshold)
        return f"{claim.metric} {sign} {shown}"

    @property
    def value(self) -> str:
        """What was measured, with its bounds: `71 [60, 80]`, `4 of 5`."""
        claim, metric = self.claim, self.metric
        if metric is None or claim.mean is None:
            return ""
        if metric.kind == "yes_no":
            return f"{round(claim.mean * claim.n)} of {claim.n}"
        scale = 100 if metric.bounded else 1
        known = [end for end in (claim.low, claim.high) if end is not None and isfinite(end)]
        ends = [significant(scale * end) for end in known]
        bounds = f" [{', '.join(ends)}]" if len(ends) == 2 and ends[0] != ends[1] else ""
        return f"{significant(scale * claim.mean)}{bounds}"

    @property
    def without(self) -> str:
        """How many finished repetitions have no value."""
        return f", {self.claim.without} without a value" if self.claim.without else ""


def claims_of(
    reading: RunContents,
    comparison: GateReport | None = None,
    passed: bool | None = None,
    ended: bool = True,
) -> Claims:
    """Of a run, with the limits against its baseline, and whether pytest passed it if that is
    known: a test may be lost with its process, and one that never ran claims nothing. One that did
    not end has not passed."""
    of_test = grouped(reading.records, lambda r: r.test)
    crashed = {test for test, of in of_test.items() if any(r.status == "failed" for r in of)}
    claims = _that_count(reading.claims, crashed)
    places = list(dict.fromkeys(map(_place, claims)))
    who = dict(zip(places, names(places, "{} {}", " "), strict=True))
    told = [_told(claim, claims, reading.metrics, who[_place(claim)]) for claim in claims]
    failures = comparison.failures if comparison else ()
    count = Counter[str](claim.verdict for claim in claims)
    count["FAIL"] += len(failures)
    rest = passed is False and not count["FAIL"]
    why = INCOMPLETE if not ended else "tests failed or did not run" if rest else ""
    standing = (v for v in ORDER if count[v] or (v == "UNDECIDED" and not ended))
    state = "FAIL" if rest else next(standing, "")
    fails = [one for one in told if one.claim.verdict == "FAIL"]
    undecided = [one for one in told if one.claim.verdict == "UNDECIDED"]
    troubles = [Trouble(text) for text in failures]
    troubles += [_trouble(one, of_test.get(one.claim.test, [])) for one in fails]
    for (subject, claimed), same in grouped(undecided, lambda t: (t.subject, t.claimed)).items():
        of = [(f"{one.who} {one.value}".rstrip() + one.without, one.claim.advice) for one in same]
        found = [f"{value} ({advice})" for value, advice in of]
        troubles.append(Trouble(f"UNDECIDED {subject}: {claimed}: {'; '.join(found)}"))
    more = max(0, len(troubles) - MOST)
    sentence = _sentence(state, count, reading.records, why)
    return Claims(state, sentence, _table(told), troubles[:MOST], more)


def _place(claim: Claim) -> tuple[str, str, str]:
    return claim.simulator, claim.mode, claim.profile


def _told(claim: Claim, claims: Sequence[Claim], metrics: Metrics, who: str) -> _Told:
    known = (*metrics.get(claim.task, ()), *COSTS, CRASHED)
    metric = next((metric for metric in known if metric.name == claim.metric), None)
    variants = {c.variant for c in claims if c.function == claim.function}
    subject = _name(claim) if len(variants) <= MOST // 3 else _function(claim)
    if any(_function(c) == _function(claim) and c.function != claim.function for c in claims):
        subject = subject.replace(_function(claim), claim.function, 1)  # of several of that name
    return _Told(claim, metric, subject, who)


def _function(claim: Claim) -> str:
    return claim.function.rpartition("::")[2]


def _name(claim: Claim) -> str:
    return f"{_function(claim)} {claim.variant}".rstrip()


def _that_count(found: Sequence[Claim], crashed: Collection[str]) -> list[Claim]:
    """The last of each; of a test as a whole, only that it failed and no claim of it says why. What
    failed counts no more where the resumed test passed as a whole, nor what an earlier attempt of
    a test said of crashes where its last one has none. What was taken back stands open until its
    test is judged again."""
    last_of = {claim.identity: claim for claim in found}
    judged = {claim.test for claim in last_of.values() if claim.verdict}
    every = [
        claim if claim.verdict else replace(claim, verdict="UNDECIDED", advice=OPEN, mean=None)
        for claim in last_of.values()
        if claim.verdict or claim.test not in judged
    ]
    passed = {claim.test for claim in every if not claim.metric and claim.verdict == "PASS"}
    last = [
        claim
        for claim in every
        if claim.verdict != "FAIL"
        or (claim.test not in passed and (claim.metric != CRASHED.name or claim.test in crashed))
    ]
    failed = {claim.test for claim in last if claim.metric and claim.verdict == "FAIL"}
    return [
        claim
        for claim in last
        if claim.metric or (claim.verdict == "FAIL" and claim.test not in failed)
    ]


def _sentence(state: str, count: Counter[str], records: Sequence[Record], why: str) -> str:
    ended = [record for record in records if record.status != "interrupted"]
    crashed = sum(record.status == "failed" for record in ended)
    cut = len(records) - len(ended)
    repetitions = f"{why}; " * bool(why) + f"{crashed} of {len(ended)} repetitions crashed"
    repetitions += f", {cut} cut short" * bool(cut)
    total = sum(count.values())
    if not total:
        return f"{state}   {NO_CLAIM}; {repetitions}".lstrip()
    parts = [f"{count['FAIL']} of {total} claims fail" if count["FAIL"] else f"{total} claims"]
    if not count["FAIL"]:
        parts = [f"{count['PASS']} of {total} claims hold"]
    if count["UNDECIDED"]:
        parts.append(f"{count['UNDECIDED']} undecided")
    if count["XFAIL"]:
        parts.append(f"{count['XFAIL']} known to fail")
    return f"{state}   {', '.join(parts)}; {repetitions}"


def _table(told: Sequence[_Told]) -> Table:
    """A row for each subject and claim, those that fail first, a column for each simulator; several
    tests in one cell are counted."""
    if not told:
        return Table("Claims", [])
    failing = sorted(told, key=lambda one: one.claim.verdict != "FAIL")
    rows = grouped(failing, lambda one: (one.subject, one.claimed))
    found = [Column("claim", [f"{subject}: {text}" for subject, text in rows], left=True)]
    for name in dict.fromkeys(one.who for one in told):
        cells = [_cell([one for one in row if one.who == name]) for row in rows.values()]
        found.append(Column(name, cells, left=True))
    return Table("Claims", found, ONE_SIDED if any("[" in one.value for one in told) else "")


def _cell(told: Sequence[_Told]) -> str:
    """Verdict and value; of several claims how many have each verdict."""
    if len(told) == 1:
        return f"{told[0].claim.verdict} {told[0].value}".rstrip() + told[0].without
    count = Counter[str](one.claim.verdict for one in told)
    return ", ".join(f"{count[verdict]} {verdict}" for verdict in ORDER if count[verdict])


def _trouble(told: _Told, records: Sequence[Record]) -> Trouble:
    """A claim that failed, with the repetition that speaks most against it; a crashed one first."""
    claim, metric = told.claim, told.metric
    test = f"FAIL {told.who}, {_name(claim)}"
    crashed = [record for record in records if record.status == "failed"]
    if not claim.metric:
        worst = next(iter([*crashed, *records]), None)
        return Trouble(f"{test}: {claim.advice}", "", command(worst) if worst else "")
    many = f", {claim.crashed} crashed" if claim.crashed else ""
    what = f"{test}: {told.claimed} is {told.value} over {claim.n} repetitions{many}{told.without}"
    known = [record for record in records if record.task == claim.task]
    own = [r for r in known if claim.parameters in ("", task_parameters(r))]
    worst = next((record for record in crashed if record in own), None)
    why = f"crashed: {worst.error.cause}" if worst and worst.error else ""
    if worst is None and metric is not None:
        pick = min if claim.relation == "at least" else max
        told_of = [(v, r) for r in own if (v := r.value(metric)) is not None]
        value, worst = pick(told_of, key=lambda pair: pair[0], default=(0.0, None))
        why = f"has {metric.format(value)}"
    if worst is None:
        return Trouble(what)
    where = f"seed {worst.seed}, repetition {worst.repetition}"
    return Trouble(what, f"{where} {why}", command(worst))


def command(record: Record) -> str:
    """What runs the same seed of the same test again; empty where its id is no plain one.

    Settings that `--sim-set` changed are not in it. A profile, a robot or a time step in the id is
    one of several that the run had: a run of this one alone has none there.
    """
    file, _, name = record.function.partition("::")
    step = record.settings.get("timestep")
    alone = f"{record.function}[{record.simulator}-{record.mode}"
    ours_first = record.test.startswith(alone)
    test = f"{'-'.join(filter(None, [alone, record.variant]))}]" if ours_first else record.test
    fine = name and record.test.isprintable() and not file.startswith(("-", "/", "."))
    if not fine or ".." in file or not file.endswith(".py"):
        return ""
    built = any(option.startswith("--sim-name=") for option in record.notes.needs)
    options = [
        *[f"--sim-name={record.simulator}"] * (not built),
        f"--sim-seed={record.seed}",
        "--sim-reps=1",
        f"--sim-profile={record.notes.profile_file or record.profile}",
        f"--sim-protocol={record.protocol}",
        f"--sim-jitter={record.jitter:g}",
        *[f"--sim-robot={record.robot.get('name')}"] * bool(record.robot),
        *["--sim-gui"] * (record.mode == "gui"),
        *[f"--sim-set={record.simulator}.timestep={step!r}"] * record.swept,
        *record.notes.needs,
    ]
    if not all(map(str.isprintable, options)):
        return ""
    return shlex.join(["pytest", test, *options])
