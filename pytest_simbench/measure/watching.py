"""What did a release change, against the one before it? The verdict of `simbench watch`.

Laws and the ends of scenes change by the rules of `history` and `settling`. Outcomes, costs and
crashes are gated in both directions. All comparisons of all releases of one watch share the error
of 5 %: a watch in which nothing changed tells of a change in at most one of twenty.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from pytest_simbench.ground.versions import RELEASE
from pytest_simbench.measure.gate import run_gate
from pytest_simbench.measure.history import FACTOR, law_histories
from pytest_simbench.measure.limits import Limit
from pytest_simbench.measure.settling import ALIKE, Settled, settlings
from pytest_simbench.records.folder import RunContents
from pytest_simbench.records.metrics import significant
from pytest_simbench.records.record import Record
from pytest_simbench.records.series import Configured, side_by_side

DIRECTIONS = {"worse": False, "better": True}
"""In each the later release is gated; *better* with the two releases exchanged."""


@dataclass(frozen=True)
class Step:
    """A release and the one before it.

    Attributes:
        engine, old, new: the simulator and two releases of it.
        changed: what is certain and larger than its limit, one sentence each.
        told: what else a reader should know: what may be noise, what was not compared.
        reports: pages of the runs by what was run, relative to the watch's folder.
        day: when it was judged.
    """

    engine: str
    old: str
    new: str
    changed: Sequence[str] = ()
    told: Sequence[str] = ()
    reports: Mapping[str, str] = field(default_factory=dict)
    day: str = ""

    @property
    def names(self) -> tuple[str, str]:
        """The two releases as names of simulators."""
        return f"{self.engine}{RELEASE}{self.old}", f"{self.engine}{RELEASE}{self.new}"


Found = Iterator[tuple[bool, str]]
"""Sentences, and whether each is of a change."""


def of_laws(step: Step, records: Sequence[Record]) -> Found:
    """Which laws the release broke, mended, missed by more or less, or does not run any more."""
    for history in law_histories(records, fewest=1):
        yield from ((True, sentence) for sentence in history.changed(step.new))
        if lost := ", ".join(history.lost(step.old, step.new)):
            yield True, f"was kept, did not run: {lost}"
        if moved := ", ".join(history.moved(step.old, step.new)):
            yield False, f"kept by both, by one at least {FACTOR:g} times as closely: {moved}"


def of_tasks(step: Step, run: RunContents, limits: Sequence[Limit], steps: int) -> Found:
    """Which outcomes, costs and crash rates it changed, among so many steps of a watch."""
    beside = len(DIRECTIONS) * steps - 1
    for word, exchanged in DIRECTIONS.items():
        first, second = reversed(step.names) if exchanged else step.names
        sides = side_by_side(run.records, first, [second])
        gate = run_gate(*sides, limits, run.metrics, typed=False, beside=beside)
        for change in gate.changes:
            means = [change.comparison.first, change.comparison.second]
            before, after = map(change.metric.format, reversed(means) if exchanged else means)
            if change.loss > 0 and change.significant:
                yield (
                    change.exceeded,
                    f"{_task(change.test)}: {change.metric.name} {before} -> {after}, {word} by "
                    f"{change.limit.describe(change.metric, change.loss)} (limit "
                    f"{change.limit.describe(change.metric, change.limit.amount)}, "
                    f"p = {change.p_value:.2g})",
                )
        if not exchanged:
            yield from ((True, sentence) for sentence in gate.broken)
            yield from ((False, sentence) for sentence in gate.notes)


def of_scene(step: Step, name: str, records: Sequence[Record]) -> Found:
    """Whether the bodies of a scene end elsewhere, and whether the scene's own noise explains it;
    also where a release does not run it any more."""
    ends: dict[str, tuple[Settled, Configured]] = {
        who[0]: (settled, who) for settled in settlings(records) for who in settled.written
    }
    if not ends.keys() >= {*step.names}:
        done = ends or {record.simulator for record in records if record.ok}
        old, new = (simulator in done for simulator in step.names)
        how = "not in both" if old == new else "no more" if old else "where it did not before"
        yield old != new, f"{name}: as it is written it ends {how}"
        return
    (settled, before), (_, after) = (ends[simulator] for simulator in step.names)
    gap, body = settled.apart(settled.written[before], settled.written[after])
    if gap <= ALIKE:
        return
    if math.isnan(gap):
        yield False, f"{name}: no start ended in both, so nobody knows whether it ends elsewhere"
        return
    told = f"{name}: {body} ends {significant(gap, 2)} mm elsewhere"
    moved = settled.explained(before, after)
    if moved is not None:
        start = f"a start moved by {significant(1000 * moved)} mm"
        yield False, f"{told}; {start} does so within one release"
    elif settled.tried(before, after) is not None:
        yield True, f"{told}; no start that was moved does so"
    else:
        how = "ended in both" if settled.moved else "was tried"
        yield False, f"{told}; no moved start {how}, so it may be noise"


def _task(test: str) -> str:
    """What a test is of, by its id."""
    return test.rpartition("::")[2].partition("[")[0].removeprefix("test_")
