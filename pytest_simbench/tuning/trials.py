"""Candidates: settings, and the ordinary repetitions that tell their cost and error."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from statistics import fmean
from typing import Any

from pytest_simbench.client.errors import Unavailable, WorkerError
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.executor import Executor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.identity import settings
from pytest_simbench.experiment.repeater import ProgressLine, Repeater
from pytest_simbench.experiment.resumed import Resumed
from pytest_simbench.laws import Law
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.records.record import Record
from pytest_simbench.scene.policy import LoopError
from pytest_simbench.tuning.target import (
    CONVERGED,
    FAILED,
    FINER,
    FIRST_CHOSEN,
    Look,
    Target,
    TuningError,
)

CHEAPER = 0.9
"""What another candidate may have cost of this one's, so that this one is hopeless: less of a
difference may be the machine's noise."""

SLOWER = 4.0
"""Times as long as today's settings a repetition may take before it is ended: cheaper ones
are looked for, and a busy machine takes twice as long. (With 10 times one candidate took 7
of 36 minutes.)"""

SHORTEST = 30.0
"""Of such a time-out [s]: what starting a worker takes is no fault of the settings."""

FEWEST = 3
"""Candidates that a budget must be enough for."""


@dataclass(eq=False)
class Runs:
    """Repetitions. What the run folder holds already is not repeated.

    Attributes:
        executor, progress, folder: where, what tells of it, and where records go.
        resumed: what was left in the folder.
        spent: what of it was taken took [s].
    """

    executor: Executor
    progress: ProgressLine
    folder: RunFolder
    resumed: Resumed | None = None
    spent: float = 0.0

    def records(self, experiment: Experiment, numbers: Sequence[int]) -> dict[int, Record]:
        """Of these repetitions, by number; without those that were ended because another one ended
        all.

        Raises:
            TuningError: it cannot be run here.
        """
        if problem := experiment.problem():
            raise TuningError(problem)
        kept = self.resumed.take(experiment, None) if self.resumed else {}
        had = [kept[number].cost("total") or 0.0 for number in numbers if number in kept]
        self.spent += max(had, default=0.0)  # they were had at once
        if missing := [number for number in numbers if number not in kept]:
            self.folder.describe(experiment.task)
            before = len(self.folder.own)
            repeater = Repeater(
                experiment, self.executor, self.progress, self.folder.append, records_refusals=True
            )
            try:
                repeater.run(missing)
            except Unavailable as error:
                raise TuningError(error.what) from None
            except (WorkerError, LoopError):  # another world, a step that is none: its record tells
                pass
            made = [r for r in self.folder.own[before:] if r.status != "interrupted"]
            kept |= {record.repetition: record for record in made}
        return {number: kept[number] for number in numbers if number in kept}


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
    errors: dict[Look, Any] = field(default_factory=dict)
    costs: dict[Look, float] = field(default_factory=dict)
    ended: str = ""

    @property
    def failed(self) -> int:
        """Repetitions that failed."""
        return sum(not record.ok for record in self.records.values())

    def cost(self, looks: Sequence[Look] = ()) -> float:
        """The mean, over all looks or some, of tasks and of laws together; infinite where there is
        none. Of several looks at a law the least counts: they differ by the machine's noise alone.
        """
        known = least_costs({k: self.costs[k] for k in looks or self.costs if k in self.costs})
        means: dict[str, list[float]] = {}
        for look, cost in known.items():
            kind = "" if isinstance(look.task, Law) else look.task.name
            means.setdefault(kind, []).append(cost)
        return fmean(map(fmean, means.values())) if means else float("inf")


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
        case: how repetitions are run, with the settings that the search began with.
        runs: its repetitions. As many looks at a task as there are jobs are had at once, and told
            one after the other: what is had beyond the one that ends a candidate does not count.
    """

    target: Target
    case: Case
    runs: Runs
    timeout: float | None = None
    _first: dict[tuple[str, Look], Record] = field(default_factory=dict)

    def today(self, seconds: float = math.inf) -> Candidate:
        """The settings that the search of so many `seconds` began with; the time-outs of the others
        follow.

        Raises:
            TuningError: no repetition has a cost and an error, or there is too little time, which
                is said as soon as it is known.
        """
        found, looks = Candidate("today", {}), self.target.chosen
        for one in (*self._finer(""), found):
            for _ in self._looks(one, looks):
                times = [record.cost("total") or 0.0 for record in found.records.values()]
                jobs = self.runs.executor.slots  # so many were had at once
                if seconds < FEWEST * sum(times) / jobs:
                    whole = len(looks) * sum(times) / len(times) / jobs
                    raise TuningError(
                        f"{seconds:.0f} s are too few to search: today's settings alone take "
                        f"{whole:.0f} s; give a budget of at least {1 + 4 * whole / 60:.0f}min for "
                        "each simulator"
                    )
            if not (one.costs and one.errors):
                record = next(iter(one.records.values()))
                why = record.error.message if record.error else "none has a cost and an error"
                what = "today's settings" if one is found else f"{FINER} times as many steps"
                raise TuningError(f"{what} cannot be judged: {why:.300}")
        self.target = self.target.beside(found.errors)
        self.timeout = float(max(SHORTEST, round(SLOWER * max(times))))
        return found

    def choose(self, name: str, changes: Mapping[str, Any], done: Sequence[Candidate]) -> Candidate:
        """Look at settings, until it is known that they are hopeless: a finished candidate had on
        the same looks at most `CHEAPER` of the cost, and in all an error that this one cannot come
        below, were all its other looks without one; or that is more than the target's `most`; or
        more repetitions failed than of today's."""
        found = Candidate(name, changes)
        for look in self._looks(found, self.target.chosen):
            if found.failed > done[0].failed:
                error = found.records[look].error
                found.ended = f"failed: {error.cause if error else 'for no known reason'}"
                return found
            if len(found.records) < len(self.target.chosen) and self._hopeless(found, done):
                found.ended = f"hopeless after {len(found.records)} of {len(self.target.chosen)}"
                return found
        return found

    def judge(self, *candidates: Candidate, looks: Sequence[Look]) -> list[Candidate]:
        """The candidates on the half that they were not chosen on; in turns, so that a machine that
        slows down slows all."""
        found = [Candidate(one.name, one.changes, "held_out") for one in candidates]
        jobs = self.runs.executor.slots
        for part in (looks[k : k + jobs] for k in range(0, len(looks), jobs)):
            for one in (*self._finer("held_out"), *found):
                for _ in self._looks(one, part):
                    pass
        return found

    def _finer(self, half: str) -> list[Candidate]:
        """Today's settings with the smaller time step, where that tells what is right."""
        if not self.target.converged:
            return []
        step = settings(self.case)["timestep"] / FINER
        return [Candidate(CONVERGED, {"timestep": step}, half)]

    def error(self, found: Candidate) -> float:
        """Of what was looked at; of the rest it is taken to be alike, or of laws right. The worst
        where nothing tells it."""
        if not found.errors:
            return FAILED
        chosen = self.target.chosen if self.target.laws and not found.half else ()
        return self.target.together(found.errors, chosen)

    def _hopeless(self, found: Candidate, done: Sequence[Candidate]) -> bool:
        chosen, looks = self.target.chosen, list(found.costs)
        least = self.target.together(found.errors, chosen)
        if least > self.target.most:
            return True
        return self.target.comparable(looks) and any(
            self.target.together(other.errors, chosen) <= least
            and other.cost(looks) <= CHEAPER * found.cost()
            for other in done
            if not other.ended
        )

    def _looks(self, found: Candidate, looks: Sequence[Look]) -> Iterator[Look]:
        """Have a candidate's looks, one after the other."""
        ahead: dict[Look, Record] = {}
        jobs = self.runs.executor.slots
        for k, look in enumerate(looks):
            if look not in ahead:
                batch = [one for one in looks[k : k + jobs] if one.task is look.task]
                ahead |= self._records(found, batch)
            if look not in ahead:  # another one of them ended all
                ahead |= self._records(found, [look])
            record = found.records[look] = ahead[look]
            first = self._first.setdefault((found.half, look), record)
            error = self.target.error(look, record, first)
            if error is not None:
                found.errors[look] = error
            cost = record.cost(self.target.cost) if record.ok else None
            if cost is not None:
                found.costs[look] = cost
            yield look

    def _records(self, found: Candidate, looks: Sequence[Look]) -> dict[Look, Record]:
        """Of looks at one task."""
        experiment = Experiment(self._case(found), looks[0].task)
        made = self.runs.records(experiment, [look.number for look in looks])
        return {look: made[look.number] for look in looks if look.number in made}

    def _case(self, found: Candidate) -> Case:
        variant = "-".join(filter(None, [found.name, found.half]))
        function = f"tune_{self.target.word}"
        where = f"{self.case.simulator}-{self.case.mode}"
        return replace(
            self.case,
            test=f"{function}[{where}-{variant}]",
            function=function,
            variant=variant,
            changes={**self.case.changes, **found.changes},
            seed=self.target.first_judged if found.half else FIRST_CHOSEN,
            timeout=self.case.timeout if found.name in ("today", CONVERGED) else self.timeout,
        )
