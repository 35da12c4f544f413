"""Did it get worse? A run's records against a baseline's, with limits.

A limit is exceeded when the change is both larger than it and significant: a one-sided permutation
test of the means, paired by seed where the runs share their seeds, corrected (Holm) for all
comparisons of the run. The shares of crashed repetitions are always compared, by exact tests of
their own (`crashes`). A run without a true change fails in at most one of twenty cases, crashes and
limits together. A limit that compares nothing fails the run.

What it needs: a change of d with a spread of s between repetitions is found in 4 of 5 cases by
about 12 (s / d)^2 repetitions, if its limit is well below d. A loss
of 10 points in *placed* against `placed:5%,ram:10%,rtf:20%` is found by 20 repetitions in 99 of 100
runs when every cube is lost a little more often (s = 9 points), but only in 25 when one repetition
in five loses half its cubes (s = 20): that takes about 45, and one in ten that loses all of them
about 90 (docs/gate.md; real records, resampled; tests/measure/test_gate.py).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from pytest_simbench.measure import crashes
from pytest_simbench.measure.change import UNKNOWN, Change, Untested, change_of, smallest_p
from pytest_simbench.measure.comparison import ALPHA, PERMUTATIONS, compare_by_seed, holm
from pytest_simbench.measure.limits import Limit
from pytest_simbench.measure.results import ResultSet
from pytest_simbench.records.configuration import differences, other_meanings
from pytest_simbench.records.folder import RunContents
from pytest_simbench.records.metrics import CRASHED, Metric
from pytest_simbench.records.record import Record
from pytest_simbench.records.series import by_test, grouped


@dataclass(frozen=True)
class GateReport:
    """What a comparison with a baseline found.

    Attributes:
        differences: settings, versions and machines that are not the same: read them first.
        changes: every comparison that can fail the run: those of the limits, then of each test the
            share of crashed repetitions, and of those that finished without a value.
        others: metrics without a limit, tested in both directions and corrected among
            themselves: nothing fails for them, and they take nothing from the limits' certainty.
        broken: tests that gave no result any more and limits that cannot fail or compared nothing,
            one sentence each.
        notes: what could not be compared, and why.
    """

    differences: tuple[str, ...] = ()
    changes: tuple[Change, ...] = ()
    others: tuple[Change, ...] = ()
    broken: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def failures(self) -> tuple[str, ...]:
        """One sentence for each limit exceeded and each broken test; empty: the gate is passed."""
        return (*self.broken, *(c.sentence() for c in self.changes if c.exceeded))

    @property
    def compared(self) -> bool:
        """Whether a limit on anything but crashes compared something."""
        return any(change.metric != CRASHED for change in self.changes)


def run_gate(
    baseline: Iterable[Record],
    current: Iterable[Record],
    limits: Sequence[Limit],
    metrics: Mapping[str, Sequence[Metric]],
    *,
    typed: bool = True,
    beside: int = 0,
) -> GateReport:
    """Compare this run with the one of a baseline, by the metrics of each task.

    `typed` limits are for this very run: one that compares nothing fails it, else it is a note.
    Where there are so many comparisons of runs `beside` this one, they share the error.
    """
    baseline, current = list(baseline), list(current)
    before, after = (
        {name: ResultSet(found, metrics.get(found[0].task, ())) for name, found in side.items()}
        for side in by_test([baseline, current])
    )
    robots = [_robots(baseline), _robots(current)]
    common = [test for test in after if test in before]
    notes = [f"{test} is not in the baseline and is not compared" for test in after.keys() - before]
    notes += [f"{test} is in the baseline but did not run" for test in before.keys() - after]
    if notes and robots[0] != robots[1]:
        notes.append(
            f"the baseline was made with {' and '.join(robots[0])}, this run with "
            f"{' and '.join(robots[1])}: different robots are not comparable"
        )
    broken = [_broken(test, before[test], after[test]) for test in common]
    broken += dict.fromkeys(  # limits, of metrics known only now, that cannot be exceeded
        limit.vain(after[test].metric(limit.metric))
        for test in common
        for limit in limits
        if limit.metric in after[test].known
    )
    share = 1 / (1 + beside)
    crashes_may = next((limit for limit in limits if limit.metric == CRASHED.name), NO_MORE)
    limits = [limit for limit in limits if limit.metric != CRASHED.name]
    # So many are drawn that each can be significant, though some of them are the observed one.
    finest = max(PERMUTATIONS, math.ceil(5 * len(limits) * len(common) / (ALPHA * share)))
    found = {
        limit: {
            test: change_of(test, before[test], after[test], limit, permutations=finest)
            for test in common
        }
        for limit in limits
    }
    tested = [change for of_limit in found.values() for change in of_limit.values()]
    sides = {test: (before[test], after[test]) for test in common}
    limited_in = (
        (test, after[test].metric(limit.metric))
        for limit, of_limit in found.items()
        for test, change in of_limit.items()
        if isinstance(change, Change) or (change.lost and not typed)
    )
    lost, left = _rises(sides, crashes_may, limited_in, share)
    changes = _corrected(tested, left * share)
    limited = {limit.metric for limit in limits}
    others = _corrected(
        change_of(test, before[test], after[test], Limit(name, 0.0, True), both_ways=True)
        for test in common
        for name in after[test].known
        if name not in limited
    )
    if not common and (limits or typed):
        broken.append(_nothing_in_common(before, after))
    number = max(1, sum(change.by_chance for change in changes))
    few = [
        f"{change.test}: {change.repetitions} are too few for a change of {change.metric.name} "
        f"to be significant among {number} comparisons"
        for change in changes
        if smallest_p(change.comparison, finest) * number > ALPHA * share
    ]
    notes += few
    for limit, of_limit in found.items():
        reasons = {test: why for test, why in of_limit.items() if isinstance(why, Untested)}
        if common and len(reasons) == len(common):
            (broken if typed else notes).append(f"{limit} compared nothing: {_told(reasons)}")
        else:
            apart = {test: untested for test, untested in reasons.items() if untested != UNKNOWN}
            for test, (why, gone) in apart.items():
                fails = typed and gone and after[test].ok
                (broken if fails else notes).append(f"{test}: {limit} is not tested: {why}")
    if typed and few and len(few) == len(changes) and crashes_may is NO_MORE:
        broken.append("no limit can fail with so few repetitions; raise --reps in both runs")
    number = max(1, sum(change.by_chance for change in others))
    seen = [change for change in others if change.visible]
    most = min(seen, key=lambda change: smallest_p(change.comparison), default=None)
    # Twice as large a p value: it is of both directions.
    if most and not most.significant and 2 * smallest_p(most.comparison) * number > ALPHA:
        notes.append(
            f"metrics without a limit: {most.repetitions} are too few for a change to be "
            f"significant among {number} comparisons"
        )
    named = differences({test: (before[test].records, after[test].records) for test in common})
    return GateReport(
        tuple(named),
        (*changes, *lost),
        others,
        tuple(filter(None, broken)),
        tuple(sorted(notes)),
    )


def gate_runs(
    baseline: RunContents, run: RunContents, limits: Sequence[Limit] = (), *, typed: bool = True
) -> GateReport:
    """The same of two runs, which say what their metrics mean; see `run_gate`."""
    metrics = {**baseline.metrics, **run.metrics}
    report = run_gate(baseline.records, run.records, limits, metrics, typed=typed)
    other = other_meanings(baseline.tasks, run.tasks)
    return replace(report, differences=(*other, *report.differences))


def _robots(records: Sequence[Record]) -> list[str]:
    """Names of the robots that were chosen, sorted; of the tasks' own, one that says so."""
    return sorted({record.robot.get("name", "the tasks' own robot") for record in records})


def _nothing_in_common(before: Iterable[str], after: Iterable[str]) -> str:
    sides = (", ".join([*names][:3]) + ", ..." * (len([*names]) > 3) for names in (after, before))
    here, there = (names or "no repetition" for names in sides)
    return (
        "nothing was compared: no test of this run is in the baseline (this run has "
        f"{here}; the baseline {there})"
    )


def _told(reasons: Mapping[str, Untested]) -> str:
    """Why tests were not compared, each reason once, with the tests."""
    tests = grouped(reasons, lambda test: reasons[test].why)
    return "; ".join(f"{why} ({', '.join(found)})" for why, found in tests.items())


def _corrected(found: Iterable[Change | Untested], error: float = 1.0) -> tuple[Change, ...]:
    """The changes, with the p values of those that chance could bring corrected for their number,
    where they have that share of the error."""
    changes = [change for change in found if isinstance(change, Change)]
    p_values = iter(holm([change.p_value for change in changes if change.by_chance]))
    return tuple(
        replace(c, p_value=min(1.0, next(p_values) / error)) if c.by_chance else c for c in changes
    )


def _broken(test: str, old: ResultSet, new: ResultSet) -> str:
    """A sentence when nothing finishes any more, so that there is no metric to compare."""
    if not old.ok or new.ok or not new.crashed:
        return ""
    return (
        f"{test}: none of {len(new.crashed)} repetitions finished (most often "
        f"{next(iter(new.causes()))}); {len(old.ok)} of {len(old)} did in the baseline"
    )


def _rises(
    sides: Mapping[str, tuple[ResultSet, ResultSet]],
    crashes_may: Limit,
    limited: Iterable[tuple[str, Metric]],
    share: float,
) -> tuple[list[Change], float]:
    """By test the change of the share of crashed repetitions, then of those that finished without
    a value of a metric that has a limit, which may not rise; and the part of the error that is left
    for the limits."""
    counted = [
        (test, CRASHED, crashes_may, old.by_seed(CRASHED), new.by_seed(CRASHED))
        for test, (old, new) in sides.items()
    ]
    for test, metric in limited:
        both, name = sides[test], f"repetitions without {metric.name}"
        if any(side.without(metric) for side in both):
            lacking = Metric(name, name, better="lower", kind="yes_no")
            first, second = (
                {r.seed: float(side.value(r, metric) is None) for r in side.ok} for side in both
            )
            counted.append((test, lacking, NO_MORE, first, second))
    found, chances = [], []
    for test, metric, limit, first, second in counted:
        if first and second:
            comparison = compare_by_seed(first, second, "greater")
            chances.append(crashes.rise(first, second, comparison.paired))
            loss = limit.loss(metric, comparison.first, comparison.second)
            found.append(Change(test, metric, limit, comparison, 1.0, loss))
    p_values, left = crashes.corrected(chances)
    shared = [min(1.0, p_value / share) for p_value in p_values]
    return [replace(c, p_value=p) for c, p in zip(found, shared, strict=True)], left


NO_MORE = Limit(CRASHED.name, 0.0, True)
"""What holds of crashes when nobody says anything, and of values that are missing: their share may
not rise."""
