"""What settings are chosen by and judged by: laws, or seeds of a task, each in two halves."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from pytest_simbench.ground.errors import SimulatorError
from pytest_simbench.laws import LAWS, Law
from pytest_simbench.laws.held_out import held_out
from pytest_simbench.records.metrics import COSTS, Metric, UnknownMetric
from pytest_simbench.records.phenomena import PHENOMENA
from pytest_simbench.records.record import Record
from pytest_simbench.simulator import Capability
from pytest_simbench.tasks import Pushing, Stacking, Throwing
from pytest_simbench.tasks.base import Task

LAWS_WORD = "laws"

TASKS: Mapping[str, tuple[type[Task], str]] = {
    "stacking": (Stacking, "at_end"),
    "throwing": (Throwing, "hit"),
    "pushing": (Pushing, "position_error"),
}
"""Tasks by name, and the metric by which they are chosen where nobody names one."""

FIRST_CHOSEN, FIRST_JUDGED = 300_001, 350_001
"""Seeds of the two halves; runs that name none begin at 10001, and no published one is of them."""

FAILED = 1e6
"""Error of a repetition that failed, where the worst is not known: nothing that ends is so far off.
"""

FLOOR = 0.01
"""Of a law's error: below a hundredth of its tolerance nothing is better."""


TIMES = (1, 2, 3)
"""Looks at each law. Its error is the same each time; of its cost, a few milliseconds, the least
counts."""


class TuningError(SimulatorError):
    """A search that cannot be; the message is one sentence."""


@dataclass(frozen=True)
class Look:
    """One repetition that a candidate is looked at by: a task and its number, from 1."""

    task: Task
    number: int = 1


@dataclass(frozen=True)
class Target:
    """What is tuned for.

    Attributes:
        name: as it was given.
        cost: name of one of `records.metrics.COSTS`, the less the better.
        chosen, judged: by what candidates are chosen, and what is kept for the verdict.
        metric: of the task; None for laws.
        right: the right value of the metric, where it is known.
    """

    name: str
    cost: str
    chosen: tuple[Look, ...]
    judged: tuple[Look, ...]
    metric: Metric | None = None
    right: float | None = None

    @property
    def unit(self) -> str:
        """What an error is told in."""
        return "tolerances" if self.metric is None else "" if self.metric.bounded else "of it"

    @property
    def deterministic(self) -> bool:
        """Whether seeds do not matter."""
        return self.metric is None

    def error(self, record: Record, today: Record) -> float:
        """Of one repetition, 0 or more. A law's is told in its tolerance at the step of today's
        profile, for every candidate: a longer step would be allowed more."""
        if self.metric is None:
            mine, theirs = record.notes.reading, today.notes.reading
            if mine is None:
                return FAILED
            allowed = theirs.tolerance if theirs else mine.tolerance
            return max(FLOOR, min(FAILED, mine.error / allowed))
        value = record.value(self.metric)
        if value is None or not math.isfinite(value):
            return FAILED
        if self.right is not None:
            return abs(value - self.right)
        best = 1.0 if self.metric.bounded and self.metric.better == "higher" else 0.0
        return abs(value - best)

    def together(self, errors: Mapping[Look, float]) -> float:
        """The error of a candidate from those of its looks; one that has not been had counts as
        without one. Of a task the mean; of laws the geometric mean of the phenomena's worst."""
        looks = self.chosen if errors.keys() <= set(self.chosen) else tuple(errors)
        values = {look: errors.get(look, 0.0) for look in looks}
        if self.metric is not None:
            return sum(values.values()) / len(values)
        worst: dict[str, float] = {}
        for look, value in values.items():
            of = getattr(look.task, "phenomenon", "")
            worst[of] = max(worst.get(of, FLOOR), value)
        return math.exp(sum(map(math.log, worst.values())) / len(worst))


def target(
    name: str,
    cost: str,
    error: str | None,
    seeds: int,
    judged: int,
    can: Collection[Capability] = tuple(Capability),
) -> Target:
    """What a command line names.

    Args:
        name: `laws:NAME,...` with phenomena or laws, or the name of a task.
        cost: of `records.metrics.COSTS`.
        error: the metric to choose by; None for the task's own.
        seeds, judged: of a task, for choosing and for judging, at most.
        can: what the simulator can do; laws that need more are left out.

    Raises:
        TuningError: there is nothing of that name; lists what there is.
    """
    costs = [metric.name for metric in COSTS if metric.better == "lower"]
    if cost not in costs:
        raise TuningError(f"--cost={cost:.60}: choose from {', '.join(costs)}")
    kind, colon, rest = name.partition(":")
    if colon and kind == LAWS_WORD:
        if error is not None:
            raise TuningError("--error: laws have their own, in tolerances; leave it out")
        laws = [law for law in _laws(rest.split(",")) if {*law.needs} <= {*can}]
        if not laws:
            raise TuningError(f"{name}: the simulator cannot do any of these laws")
        others = [other for law in laws if (other := held_out(law)) is not None]
        halves = (tuple(Look(law, k) for k in TIMES for law in half) for half in (laws, others))
        return Target(name, cost, next(halves), next(halves))
    if name not in TASKS:
        raise TuningError(
            f"nothing to tune for is named {name[:60]!r}; choose from {', '.join(TASKS)}, or "
            f"laws:NAME,... with {', '.join(PHENOMENA)} or single laws"
        )
    make, own = TASKS[name]
    task = make()
    known = {metric.name: metric for metric in task.metrics}
    metric = known.get(error or own)
    if metric is None or (metric.better is None and metric.name not in task.references):
        fine = [m.name for m in task.metrics if m.better or m.name in task.references]
        raise TuningError(str(UnknownMetric(error or own, fine)))
    looks = [tuple(Look(task, k) for k in range(1, n + 1)) for n in (seeds, judged)]
    return Target(name, cost, looks[0], looks[1], metric, task.references.get(metric.name))


def _laws(names: Sequence[str]) -> list[Law]:
    found: dict[str, Law] = {}
    for name in (part.strip() for part in names):
        of = [law for law in LAWS if name in (law.name, law.phenomenon)]
        if not of:
            raise TuningError(
                f"no law or phenomenon is named {name[:60]!r}; choose from "
                f"{', '.join(PHENOMENA)}, or a law of docs/truth.md"
            )
        found |= {law.name: law for law in of}
    return list(found.values())
