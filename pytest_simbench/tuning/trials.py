"""Candidates: settings, and the ordinary repetitions that tell their cost and error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.executor import Executor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repeater import ProgressLine
from pytest_simbench.experiment.resumed import Resumed
from pytest_simbench.laws import Law
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.record import Record
from pytest_simbench.tuning.runs import Runs
from pytest_simbench.tuning.target import FIRST_CHOSEN, FIRST_JUDGED, Look, Target, TuningError

CHEAPER = 0.9
"""What another candidate may have cost of this one's, so that this one is hopeless: less of a
difference may be the machine's noise."""

SLOWER = 10.0
"""Times as long as today's settings a repetition may take before it is ended."""

SHORTEST = 30.0
"""Of such a time-out [s]: what starting a worker takes is no fault of the settings."""


@dataclass(eq=False)
class Candidate:
    """Settings, and what is known of them on one half.

    Attributes:
        name: in test ids: `today`, `trial7`.
        changes: of the settings that the search began with.
        half: `held_out`, or empty for the half by which it is chosen.
        records: by look.
        ended: why it was not looked at to the end, in words; empty where it was.
    """

    name: str
    changes: Mapping[str, Any]
    half: str = ""
    records: dict[Look, Record] = field(default_factory=dict)
    errors: dict[Look, float] = field(default_factory=dict)
    costs: dict[Look, float] = field(default_factory=dict)
    ended: str = ""

    @property
    def failed(self) -> int:
        """Repetitions that failed."""
        return sum(not record.ok for record in self.records.values())

    def cost(self, looks: Sequence[Look] = ()) -> float:
        """The mean, over all looks or some; infinite where there is none. Of several looks at a law
        the least counts: they differ by the machine's noise alone."""
        known = least_costs({k: self.costs[k] for k in looks or self.costs if k in self.costs})
        return sum(known.values()) / len(known) if known else float("inf")


def least_costs(costs: Mapping[Look, float]) -> dict[Look, float]:
    """By look; of several looks at a law the least one's, under the first."""
    found: dict[Look, float] = {}
    for look, cost in costs.items():
        same = Look(look.task) if isinstance(look.task, Law) else look
        found[same] = min(cost, found.get(same, cost))
    return found


@dataclass(eq=False)
class Trials:
    """Looks at candidates. What the run folder holds already is not repeated.

    Attributes:
        target: what for.
        case: how repetitions are run, with the settings that the search began with.
        executor, progress, folder: where, what tells of it, and where records go.
        resumed: what an earlier search left in the folder.
    """

    target: Target
    case: Case
    executor: Executor
    progress: ProgressLine
    folder: RunFolder
    resumed: Resumed | None = None
    timeout: float | None = None
    _today: dict[Look, Record] = field(default_factory=dict)

    def today(self) -> Candidate:
        """The settings that the search began with; the time-outs of the others follow.

        Raises:
            TuningError: every repetition fails.
        """
        found = Candidate("today", {})
        for look in self.target.chosen:
            self._look(found, look)
        if not found.costs:
            record = next(iter(found.records.values()))
            why = record.error.message if record.error else "they fail"
            raise TuningError(f"today's settings cannot be judged: {why:.300}")
        took = [record.seconds["total"] for record in found.records.values()]
        self.timeout = float(max(SHORTEST, round(SLOWER * max(took))))
        return found

    def choose(self, name: str, changes: Mapping[str, Any], done: Sequence[Candidate]) -> Candidate:
        """Look at settings, until it is known that they are hopeless: a finished candidate had on
        the same looks at most `CHEAPER` of the cost, and in all an error that this one cannot come
        below, were all its other looks without one; or more repetitions failed than of today's."""
        found = Candidate(name, changes)
        for look in self.target.chosen:
            self._look(found, look)
            if found.failed > done[0].failed:
                error = found.records[look].error
                found.ended = f"failed: {error.cause if error else 'for no known reason'}"
                return found
            if len(found.records) < len(self.target.chosen) and self._hopeless(found, done):
                many = f"{len(found.records)} of {len(self.target.chosen)}"
                found.ended = f"hopeless after {many}"
                return found
        return found

    def judge(self, *candidates: Candidate, looks: Sequence[Look]) -> list[Candidate]:
        """The candidates on the half that they were not chosen on; in turns, so that a machine that
        slows down slows all."""
        found = [Candidate(one.name, one.changes, "held_out") for one in candidates]
        for look in looks:
            for one in found:
                self._look(one, look)
        return found

    def error(self, found: Candidate) -> float:
        """Of what was looked at; of the rest it is taken to be alike, or of laws right."""
        if self.target.metric is None:
            return self.target.together(found.errors)
        return sum(found.errors.values()) / len(found.errors)

    def _hopeless(self, found: Candidate, done: Sequence[Candidate]) -> bool:
        least, looks = self.target.together(found.errors), list(found.costs)
        return bool(looks) and any(
            self.target.together(other.errors) <= least
            and other.cost(looks) <= CHEAPER * found.cost()
            for other in done
            if not other.ended
        )

    def _look(self, found: Candidate, look: Look) -> None:
        experiment = Experiment(self._case(found), look.task)
        runs = Runs(self.executor, self.progress, self.folder, self.resumed)
        record = found.records[look] = runs.record(experiment, look.number)
        today = self._today.setdefault(look, record)
        found.errors[look] = self.target.error(record, today)
        cost = record.cost(self.target.cost) if record.ok else None
        if cost is not None:
            found.costs[look] = cost

    def _case(self, found: Candidate) -> Case:
        variant = "-".join(filter(None, [found.name, found.half]))
        function = f"tune_{self.target.name.partition(':')[0]}"
        where = f"{self.case.simulator}-{self.case.mode}"
        return replace(
            self.case,
            test=f"{function}[{where}-{variant}]",
            function=function,
            variant=variant,
            changes={**self.case.changes, **found.changes},
            seed=FIRST_JUDGED if found.half else FIRST_CHOSEN,
            timeout=None if found.name == "today" else self.timeout,
        )
