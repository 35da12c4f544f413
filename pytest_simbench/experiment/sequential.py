"""`--reps auto`: repeat until each asserted claim is decided, or a limit is reached.

Whoever judges again and again, and stops when it decides, is wrong more often than once in twenty.
So the numbers of repetitions at which it is looked are fixed beforehand, and the verdicts on a
claim share the error among the looks (Bonferroni): with K looks each may err in 0.05 / K of all
runs, so that the chance that any of them is wrong stays below 0.05.
That holds whenever one stops and for each claim by itself, also when another claim asked for the
repetitions. The price is about a third more repetitions than a single look at the right moment.

The mean of a run that stopped by itself leans to the side on which it was decided, and the tables'
95 % intervals do not know of the looks: for a number to publish, fix the repetitions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from pytest_simbench.measure.intervals import Interval
from pytest_simbench.measure.results import ResultSet
from pytest_simbench.measure.verdicts import ERROR, Bound, Judgement, judge
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.record import Record

FIRST_LOOK = 10
"""Repetitions before the first look: fewer say nothing of their own spread."""

GROWTH = 2
"""Each look has so many times the repetitions of the one before."""


@dataclass(frozen=True)
class Plan:
    """When it is looked, and how sure each look must be.

    Attributes:
        looks: numbers of repetitions, rising; the last is the limit.
        error: probability, at most, that the verdict of one look is wrong.
    """

    looks: tuple[int, ...]
    error: float

    @classmethod
    def up_to(cls, limit: int, error: float = ERROR) -> Plan:
        """Looks at 10, 20, 40, ... and at `limit`, which all together err in at most `error`."""
        looks = []
        number = FIRST_LOOK
        while number < limit:
            looks.append(number)
            number *= GROWTH
        looks.append(limit)
        return cls(tuple(looks), error / len(looks))


class SequentialResultSet(ResultSet):
    """A result set whose assertions run more repetitions while they are inconclusive.

    Args:
        records: of the first look.
        more: runs repetitions until there are so many; gives all records.
    """

    def __init__(
        self,
        records: Iterable[Record],
        metrics: Iterable[Metric],
        plan: Plan,
        more: Callable[[int], Iterable[Record]],
    ) -> None:
        super().__init__(records, metrics)
        self.plan = plan
        self.error = plan.error
        self._more = more

    def _decide(self, claim: Bound, interval: Callable[[], Interval]) -> Judgement:
        while True:
            found = judge(claim, interval())
            later = [n for n in self.plan.looks if n > len(self.records)]
            if found.verdict.decided or not later:
                return found
            self.records = tuple(self._more(later[0]))
            self._intervals.clear()
            if len(self.records) < later[0]:  # nothing came: no more than this can be had
                return judge(claim, interval())
