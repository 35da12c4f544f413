"""One metric of one test, before and after: how much it changed, how sure that is; or why it is not
compared."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from pytest_simbench.measure.comparison import ALPHA, PERMUTATIONS, MeanDifference
from pytest_simbench.measure.limits import Limit
from pytest_simbench.measure.results import ResultSet
from pytest_simbench.measure.speed import POWER, compared, without_speed
from pytest_simbench.records.metrics import COSTS, Metric


@dataclass(frozen=True)
class Change:
    """One metric of one test, before and after.

    Attributes:
        limit: how much worse it may get.
        comparison: the means and the p value: of getting worse where there is a limit, else of
            any change.
        p_value: corrected for all comparisons of the run.
        loss: how much worse, in the limit's terms; below 0: better.
        normalised: whether the machine's speed was taken out by the control workload.
    """

    test: str
    metric: Metric
    limit: Limit
    comparison: MeanDifference
    p_value: float
    loss: float
    normalised: bool = False

    @property
    def beyond(self) -> bool:
        """Whether it got worse by more than the limit; 1 - 0.95 is not more than 0.05."""
        return self.loss > self.limit.amount * (1 + 1e-9)

    @property
    def exceeded(self) -> bool:
        """Whether it did so, and not by chance."""
        return self.beyond and self.significant

    @property
    def significant(self) -> bool:
        """Whether it changed, in the direction that was tested, and not by chance."""
        return self.p_value <= ALPHA

    @property
    def by_chance(self) -> bool:
        """Whether so many repetitions can change as much by chance, and seldom: not one value that
        all repetitions have, which is certain, and not so few that nothing is ever seldom."""
        return 0 < smallest_p(self.comparison) <= ALPHA

    @property
    def visible(self) -> bool:
        """Whether an outcome changed by what means anything, if by chance; costs always vary."""
        means = self.comparison.first, self.comparison.second
        return self.metric not in COSTS and self.metric.differs(*means)

    @property
    def repetitions(self) -> str:
        """How many were compared, in words."""
        first, second = self.comparison.n
        return f"{first} pairs" if self.comparison.paired else f"{first} and {second} repetitions"

    def sentence(self) -> str:
        """What changed, by how much, and how sure."""
        before, after = self.comparison.first, self.comparison.second
        verb = "fell" if after < before else "rose" if after > before else "stayed"
        speed = ", machine speed taken out" if self.normalised else ""
        sure = f"p = {self.p_value:.2g}, {self.repetitions}{speed}"
        if self.comparison.sole:
            sure = "every repetition is the same"
        return (
            f"{self.test}: {self.metric.name} {verb} from {self.metric.format(before)} to "
            f"{self.metric.format(after)} (worse by {self.limit.describe(self.metric, self.loss)}, "
            f"limit {self.limit.describe(self.metric, self.limit.amount)}; {sure})"
        )


PAIRS = math.ceil(math.log2(1 / ALPHA))
"""With fewer no change is significant, however large: 5."""


class Untested(NamedTuple):
    """Why a metric of a test is not compared; `lost`: this run lacks values that it should have."""

    why: str
    lost: bool = False


UNKNOWN = Untested("it is not measured there")
GONE = Untested("no repetition of this run has a value", lost=True)


def change_of(
    test: str,
    old: ResultSet,
    new: ResultSet,
    limit: Limit,
    *,
    both_ways: bool = False,
    permutations: int = 0,
) -> Change | Untested:
    """The change of one metric, not yet corrected; else why there is none."""
    if not (limit.metric in old.known and limit.metric in new.known):
        return GONE if any(limit.metric in record.metrics for record in old.ok) else UNKNOWN
    metric = new.metric(limit.metric)
    if metric.better is None:
        return Untested("neither direction of it is worse")
    if _of_machines(old, new, metric.name):
        return Untested(
            "it depends on the machine, which was another one, and not every repetition has the "
            "control workload that takes the machine's speed out"
        )
    if not old.values(metric):
        return Untested("no repetition of the baseline has a value")
    if not new.values(metric):
        return GONE
    comparison, evened = compared(metric, old, new, both_ways=both_ways, permutations=permutations)
    had, ended = len(old.values(metric)), len(new.ok)
    have = sum(new.value(record, metric) is not None for record in new.ok)
    if have < ended and min(had, ended) >= PAIRS and smallest_p(comparison) > ALPHA:
        told = f"{have} of {ended} repetitions of this run have a value"
        return Untested(f"{told}, and a change takes {PAIRS} pairs or more", lost=True)
    loss = limit.loss(metric, comparison.first, comparison.second)
    return Change(test, metric, limit, comparison, comparison.p_value, loss, evened)


def _of_machines(old: ResultSet, new: ResultSet, name: str) -> bool:
    """Whether a cost tells of two machines rather than of two versions."""
    if name not in POWER or name in new.metrics:
        return False
    first, second = (
        {(r.host.get("cpu"), r.host.get("cores")) for r in side.ok} for side in (old, new)
    )
    return first != second and without_speed(name, old, new) is None


def smallest_p(comparison: MeanDifference, permutations: int = 0) -> float:
    """The smallest p value that so many repetitions can give in a permutation test that draws so
    many permutations; 0: `PERMUTATIONS`."""
    if comparison.sole:
        return 0.0
    first, second = comparison.n
    if min(first, second) < 2:
        return 1.0
    arrangements = 2**first if comparison.paired else math.comb(first + second, first)
    return 1 / min(arrangements, (permutations or PERMUTATIONS) + 1)
