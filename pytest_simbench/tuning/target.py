"""What settings are chosen by and judged by: laws, or seeds of a task, each in two halves."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from pytest_simbench import tasks
from pytest_simbench.data import impacts, pushes, tosses
from pytest_simbench.data.sets import read
from pytest_simbench.ground.errors import SimulatorError
from pytest_simbench.laws import LAWS, Law
from pytest_simbench.laws.base import held_out
from pytest_simbench.measure.verdicts import Bound
from pytest_simbench.records.metrics import COSTS, Metric, UnknownMetric
from pytest_simbench.records.phenomena import PHENOMENA
from pytest_simbench.records.record import Record
from pytest_simbench.scene.policy import Policy
from pytest_simbench.simulator import Capability
from pytest_simbench.tasks.base import Task
from pytest_simbench.tasks.measured import MeasuredTask
from pytest_simbench.tasks.on_scene import OnScene

LAWS_WORD = "laws"

TASKS: Mapping[str, tuple[Callable[[], Task], str]] = {
    "stacking": (tasks.Stacking, "at_end"),
    "throwing": (tasks.Throwing, "hit"),
    "pushing": (tasks.Pushing, "position_error"),
    "tosses": (lambda: tasks.Tossing(read(tosses.NAME)), "position_error"),
    "impacts": (lambda: tasks.Impacting(read(impacts.NAME)), "velocity_error"),
    "pushes": (lambda: tasks.ArmPushing(read(pushes.NAME)), "displacement_error"),
    "commands": (lambda: tasks.ArmFollowing(read(pushes.NAME)), "hand_error"),
}
"""Tasks by name, and the metric by which they are chosen where nobody names one."""

CONVERGED, FINER = "converged", 8
"""Error: how far from what today's settings give with the time step divided so."""

CHOSEN, REAL_CHOSEN = 4, 24
"""Seeds to choose by; of measured motions more, since they differ more."""

Claims = tuple[tuple[Metric, Bound], ...]

FIRST_CHOSEN, FIRST_JUDGED = 300_001, 350_001
"""Seeds of the two halves; runs that name none begin at 10001, and no published one is of them."""

FAILED = 1e6
"""Error of a repetition that failed, where the worst is not known: nothing that ends is so far off.
"""

SHARE_MARGIN = 0.05
"""Of shares and of yes or no: 5 points more errors are not worse."""

MARGIN = 0.1
"""Of other errors: a tenth more, or the smallest difference that means anything, is not worse. A
law or a claim that is kept is right, however well."""

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

    def __hash__(self) -> int:  # a task may hold what has none
        return hash((self.task.name, self.number))


@dataclass(frozen=True)
class Target:
    """What is tuned for.

    Attributes:
        cost: name of one of `records.metrics.COSTS`, the less the better.
        chosen, judged: by what candidates are chosen, and what is kept for the verdict.
        metric: of the task; None for laws and claims.
        claims: of a test, on its task.
        converged: whether the metric's right value is that of a smaller time step.
        first_judged: seed of the judged half's first number.
        most: an error beyond which a candidate is hopeless, whatever it costs.
    """

    name: str
    cost: str
    chosen: tuple[Look, ...]
    judged: tuple[Look, ...]
    metric: Metric | None = None
    claims: Claims = ()
    converged: bool = False
    first_judged: int = FIRST_JUDGED
    most: float = math.inf

    @property
    def parts(self) -> tuple[Target, ...]:
        """What it consists of, see `tuning.several`."""
        return (self,)

    @property
    def laws(self) -> bool:
        """Whether it is about laws, for which seeds do not matter."""
        return self.metric is None and not self.claims

    @property
    def unit(self) -> str:
        """What an error is told in."""
        if self.metric is None:
            return "limits" if self.claims else "tolerances"
        return "" if self.metric.bounded else self.metric.unit

    @property
    def period(self) -> float:
        """What any time step divides [s]: a policy's period and latency; 0 without a policy."""
        task: Any = self.chosen[0].task
        if not (policy := getattr(task, "policy", None)):
            return 0.0
        rate: float = getattr(task, "rate", 0.0) or getattr(policy, "rate", Policy.rate)
        both = 1 / rate, getattr(task, "command_latency", 0.0)
        period, late = (Fraction(seconds).limit_denominator(10**6) for seconds in both)
        while late:  # their greatest common divisor
            period, late = late, period % late
        return float(period)

    @property
    def word(self) -> str:
        """Its name for ids: `laws`, `stacking`, `test_insert`."""
        return self.name.rpartition("::")[2].partition(":")[0].partition("[")[0]

    def asks(self, look: Look) -> bool:
        """Whether it is one of its looks, of either half."""
        return look.task.name in self._tasks

    @cached_property
    def _tasks(self) -> frozenset[str]:
        return frozenset(look.task.name for look in self.chosen)

    def comparable(self, looks: Collection[Look]) -> bool:
        """Whether these are enough to hold one cost against another."""
        return bool(looks)

    def beside(self, today: Mapping[Look, Any]) -> Target:
        """The same, once the errors of today's settings are known."""
        return self

    def error(self, look: Look, record: Record, first: Record) -> Any:
        """Of one repetition, 0 or more; None where nothing tells what is right. Of claims one for
        each, below 0 on their right side.

        Args:
            first: the first record of the look: of a smaller time step, or today's. A law's error
                is told in its tolerance at the step of today's profile, for every candidate: a
                longer step would be allowed more.
        """
        if self.claims:
            return tuple(_off(record.value(metric), claim) for metric, claim in self.claims)
        if self.metric is None:
            mine, theirs = record.notes.reading, first.notes.reading
            if mine is None:
                return FAILED
            allowed = theirs.tolerance if theirs else mine.tolerance
            return max(FLOOR, min(FAILED, mine.error / allowed))
        value, right = record.value(self.metric), look.task.references.get(self.metric.name)
        if self.converged:
            right = first.value(self.metric) if first.ok else None
            if right is None or not math.isfinite(right):
                return None
        if value is None or not math.isfinite(value):
            return 1.0 if self.metric.bounded else FAILED
        best = 1.0 if self.metric.bounded and self.metric.better == "higher" else 0.0
        return abs(value - (best if right is None else right))

    def together(
        self, errors: Mapping[Look, Any], of: Sequence[Look] = (), least: float = FLOOR
    ) -> float:
        """The error of a candidate from those of its looks; what it has not had of `of` counts as
        right as can be. Of a task the mean; of claims the mean of the worst, 0 where all are kept;
        of laws the geometric mean of the phenomena's worst, each at least `least`."""
        values = {**dict.fromkeys(of, (-1.0,) * len(self.claims) or 0.0), **errors}
        if not self.laws:
            return float(max(0.0, np.max(np.mean(list(values.values()), axis=0))))
        worst: dict[str, float] = {}
        for look, value in values.items():
            phenomenon = getattr(look.task, "phenomenon", "")
            worst[phenomenon] = max(worst.get(phenomenon, least), value)
        return math.exp(sum(map(math.log, worst.values())) / len(worst))

    def allowed(self, error: float) -> float:
        """The error up to which a candidate is not worse than one with this error."""
        if self.metric is None:
            return max(1.0 if self.laws else 0.0, (1 + MARGIN) * error)
        if self.metric.bounded:
            return error + SHARE_MARGIN
        return error + max(MARGIN * error, self.metric.smallest_difference)

    def margin(self, errors: Mapping[Look, Any]) -> float:
        """By how much others may be larger together; of those that failed nothing follows."""
        ended = {k: error for k, error in errors.items() if self.laws or np.max(error) < FAILED}
        known = self.together(ended or errors, least=1.0)
        return self.allowed(known) - known


def _off(value: float | None, claim: Bound) -> float:
    """How far a value is on the wrong side of a limit, in units of the limit (of 0: of the metric);
    below 0, and at least -1, on the right side."""
    if value is None or not math.isfinite(value):
        return FAILED
    short = claim.value - value if claim.relation == "at least" else value - claim.value
    return min(FAILED, max(-1.0, short / (abs(claim.value) or 1.0)))


def target(
    name: str,
    cost: str,
    error: str | None,
    seeds: int | None,
    judged: int,
    can: Collection[Capability] = tuple(Capability),
    asked: tuple[Task, Claims] | None = None,
) -> Target:
    """What a command line names.

    Args:
        name: `laws`, or `laws:NAME,...` with phenomena or laws; the name of a task or of measured
            data; or a test's.
        cost: of `records.metrics.COSTS`.
        error: the metric to choose by, `converged` or `converged:METRIC`; None for the task's own,
            or the test's claims.
        seeds, judged: of a task, for choosing and for judging, at most.
        can: what the simulator can do; laws that need more are left out.
        asked: what a test asks for, see `cli.asked`.

    Raises:
        TuningError: there is nothing of that name; lists what there is.
        DataMissing: the measured data are not here.
    """
    costs = [metric.name for metric in COSTS if metric.better == "lower"]
    if cost not in costs:
        raise TuningError(f"--cost={cost:.60}: choose from {', '.join(costs)}")
    kind, colon, rest = name.partition(":")
    if kind == LAWS_WORD:
        if error is not None:
            raise TuningError("--error: laws have their own, in tolerances; leave it out")
        laws = [
            law for law in _laws(rest.split(",") if colon else PHENOMENA) if {*law.needs} <= {*can}
        ]
        if not laws:
            raise TuningError(f"{name}: the simulator cannot do any of these laws")
        others = [other for law in laws if (other := held_out(law)) is not None]
        halves = (tuple(Look(law, k) for k in TIMES for law in half) for half in (laws, others))
        return Target(name, cost, next(halves), next(halves))
    task: Task
    claims: Claims = ()
    if asked:
        (task, claims), own = asked, ""
    elif name in TASKS:
        make, own = TASKS[name]
        task = make()
    else:
        raise TuningError(
            f"nothing to tune for is named {name[:60]!r}; choose from {', '.join(TASKS)},"
            f" laws, laws:NAME,... with {', '.join(PHENOMENA)} or single laws, or FILE.py::TEST"
        )
    chosen, kept, first = _halves(task, seeds, judged)
    if claims and not error:
        return Target(name, cost, chosen, kept, None, claims, first_judged=first)
    word, _, behind = (error or "").partition(":")
    converged = word == CONVERGED
    claimed = {metric.name for metric, _ in claims}
    own = own or (claimed.pop() if len(claimed) == 1 else "")
    wanted = (behind if converged else error) or own
    known = {m.name: m for m in task.metrics}
    right = {*known} if converged else {*task.references}  # of what higher is better nothing is
    right |= {m.name for m in known.values() if m.better and (m.bounded or m.better == "lower")}
    fine = [m for m in known.values() if m.name in right]
    if wanted and wanted not in known:
        raise TuningError(str(UnknownMetric(wanted, [m.name for m in fine])))
    if not wanted or known[wanted] not in fine:
        why = wanted and f"nothing tells the right {wanted}; "
        option = f"--error {CONVERGED}:METRIC" if converged else "--error METRIC"
        names = ", ".join(m.name for m in fine) or "another test: no metric here has a right value"
        raise TuningError(f"{name}: {why}name what to choose by, {option} with {names}")
    return Target(name, cost, chosen, kept, known[wanted], converged=converged, first_judged=first)


def _halves(
    task: Task, seeds: int | None, judged: int
) -> tuple[tuple[Look, ...], tuple[Look, ...], int]:
    """By what it is chosen and judged, and the first seed of the latter. Measured motions have
    their halves; a scene with a few starts is chosen on the first half of them."""

    def looks(of: Task, first: int, last: int) -> tuple[Look, ...]:
        return tuple(Look(of, k) for k in range(first, last + 1))

    if isinstance(task, MeasuredTask):
        measured: Any = task
        chosen, other = (replace(measured, half=half) for half in ("chosen_on", "held_out"))
        last = min(seeds or REAL_CHOSEN, chosen.repetitions), min(judged, other.repetitions)
        return looks(chosen, 1, last[0]), looks(other, 1, last[1]), FIRST_JUDGED
    if isinstance(task, OnScene) and not getattr(task, "moved", 0.0):
        many = len(task.starts) or 1
        half = min(seeds or CHOSEN, (many + 1) // 2)
        return looks(task, 1, half), looks(task, half + 1, min(half + judged, many)), FIRST_CHOSEN
    return looks(task, 1, seeds or CHOSEN), looks(task, 1, judged), FIRST_JUDGED


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
