"""The search: Optuna proposes settings, repetitions tell cost and error, a journal keeps both.

The trials of a search come one after the other from one process. Each has a sampler of its own,
seeded by the search's seed and its number, so that a search that was interrupted goes on as it
would have; and what it has recorded it does not repeat."""

from __future__ import annotations

import json
import math
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pytest_simbench.ground.names import file_name
from pytest_simbench.simulator.ranges import Linear, Log, Searched, changes, searched
from pytest_simbench.simulator.settings import Settings
from pytest_simbench.tuning.target import TuningError
from pytest_simbench.tuning.trials import Candidate, Trials

JOURNAL = "optuna.log"
"""Of the trials, in the run folder: lines of JSON."""

STARTUP = 10
"""Trials before the sampler learns from them."""

FEWEST = 3
"""Candidates that a budget must be enough for."""


def space_of(base: Settings, names: Sequence[str] | None, simulator: str) -> tuple[Searched, ...]:
    """What is searched: all that may be, or the settings of these names.

    Raises:
        TuningError: one of them may not be, or none may; lists what may.
    """
    known = searched(type(base))
    valid = ", ".join(dict.fromkeys(one.setting for one in known))
    for name in names or ():
        if name not in {one.setting for one in known}:
            raise TuningError(
                f"{simulator} has no setting {name[:60]!r} to search; choose from {valid}"
            )
    if not known:
        raise TuningError(f"{simulator} says of none of these settings how it may be searched")
    return tuple(one for one in known if not names or one.setting in names)


def optuna() -> Any:
    """The package.

    Raises:
        TuningError: it is not here.
    """
    try:
        import optuna
    except ImportError:
        raise TuningError(
            "simbench tune needs Optuna: pip install 'pytest-simbench[tune]'"
        ) from None
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    return optuna


@dataclass(eq=False)
class Search:
    """A search in a run folder.

    Attributes:
        trials: what looks at candidates.
        base: the settings that it begins with.
        space: what is varied.
        seed: of the sampler.
        tell: takes each candidate that ended, with the front until then.
    """

    trials: Trials
    base: Settings
    space: Sequence[Searched]
    seed: int
    tell: Callable[[Candidate, Sequence[Candidate]], None]
    done: list[Candidate] = field(default_factory=list)

    def run(self, seconds: float, most: int | None = None) -> list[Candidate]:
        """Search for so long, or until there are so many trials; those of an earlier call count.
        The first of the candidates are today's settings.

        Raises:
            TuningError: no Optuna, nothing that runs, or too little time.
        """
        library = optuna()
        spent = sum(r.seconds["total"] for r in self._recorded())
        began = time.monotonic() - spent
        today = self.trials.today()
        self.done = [today]
        took = sum(record.seconds["total"] for record in today.records.values())
        if seconds < FEWEST * took and most is None:
            raise TuningError(
                f"{seconds:.0f} s are too few to search: today's settings alone took {took:.0f} s; "
                f"give a budget of at least {1 + 4 * took / 60:.0f}min"
            )
        study = self._study(library)
        known = {self._key({}): today}
        number = 0
        begun = sum(trial.state.name != "WAITING" for trial in study.trials)
        while number < begun or (
            time.monotonic() - began < seconds and (most is None or number < most)
        ):
            if number % 2 and number == len(study.trials):
                study.enqueue_trial(self._step(number))
            trial = self._trial(library, study, number)
            values = self._suggested(trial) if trial else study.trials[number].user_attrs["values"]
            asked = changes(values, self.base)
            key = self._key(asked)
            if key not in known:
                known[key] = self.trials.choose(f"trial{number}", asked, self.done)
                self.done.append(known[key])
                self.tell(known[key], front(self.done, self.trials))
            if trial is not None:
                study.tell(trial, self._values(known[key], today))
            number += 1
        return self.done

    def _recorded(self) -> Sequence[Any]:
        return self.trials.resumed.records if self.trials.resumed else ()

    def _study(self, library: Any) -> Any:
        storage = library.storages
        path = self.trials.folder.path / JOURNAL
        fresh = not path.exists()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            journal = storage.JournalStorage(storage.journal.JournalFileBackend(str(path)))
            study = library.create_study(
                study_name="simbench", storage=journal, load_if_exists=True,
                directions=["minimize", "minimize"],
            )  # fmt: skip
        if fresh:
            for values in self._first():
                study.enqueue_trial(values)
        return study

    def _trial(self, library: Any, study: Any, number: int) -> Any:
        """The trial of a number: a new one, or one that was interrupted; None where it is told."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # group is experimental
            study.sampler = library.samplers.TPESampler(
                seed=self.seed * 1_000_003 + number, multivariate=True, group=True,
                n_startup_trials=STARTUP,
            )  # fmt: skip
        states = [trial.state.name for trial in study.trials]
        if number < len(states) and states[number] == "RUNNING":
            return library.trial.Trial(study, study.trials[number]._trial_id)
        if number < len(states) and states[number] != "WAITING":
            return None
        return study.ask()

    def _suggested(self, trial: Any) -> dict[str, Any]:
        """Values for a trial. Of what does not act with the others' values none is asked for."""
        found: dict[str, Any] = {}
        settings = dict(vars(self.base))
        for one in self.space:
            if one.when and settings[one.when[0]] not in one.when[1:]:
                continue
            value = self._one(trial, one)
            found[one.name] = settings[one.setting] = value
        trial.set_user_attr("values", found)
        return found

    def _one(self, trial: Any, one: Searched) -> Any:
        if not isinstance(one.over, Linear):
            return trial.suggest_categorical(one.name, list(one.over))
        log = isinstance(one.over, Log)
        if one.whole:
            return trial.suggest_int(one.name, int(one.over.low), int(one.over.high), log=log)
        return float(f"{trial.suggest_float(one.name, one.over.low, one.over.high, log=log):.4g}")

    def _first(self) -> list[dict[str, Any]]:
        """Today's values, and each with one changed: half-way to either end of its range on its
        scale, or another choice. Most settings that are drawn at random do not work at all."""
        own, found = self._own(), [self._own()]
        for one in self.space:
            if isinstance(one.over, tuple):
                others = [choice for choice in one.over if choice != own.get(one.name, choice)]
            elif one.name in own:
                others = [
                    _between(own[one.name], end, one) for end in (one.over.high, one.over.low)
                ]
            else:
                others = []
            found += [{**own, one.name: value} for value in others if value != own[one.name]]
        return found

    def _step(self, number: int) -> dict[str, Any]:
        """The values of a point of the front with one changed: to an end of its range or half-way
        there, where Optuna's sampler hardly comes, or another choice."""
        rng = np.random.default_rng([self.seed, number])
        best = front(self.done, self.trials)
        point, one = (
            best[int(rng.integers(len(best)))],
            self.space[int(rng.integers(len(self.space)))],
        )
        found = self._own(point.changes)
        if isinstance(one.over, tuple):
            return {**found, one.name: one.over[rng.integers(len(one.over))]}
        end = (one.over.low, one.over.high)[rng.integers(2)]
        half = rng.integers(2) and one.name in found
        return {**found, one.name: _between(found[one.name], end, one) if half else end}

    def _own(self, changed: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """Today's values, some changed, as far as they lie where is searched."""
        found = {}
        settings = {**vars(self.base), **(changed or {})}
        for one in self.space:
            value = settings[one.setting]
            value = value if one.part is None else value[one.part]
            inside = value in one.over if isinstance(one.over, tuple) else (
                value is not None and one.over.low <= value <= one.over.high
            )  # fmt: skip
            if inside:
                found[one.name] = value
        return found

    def _key(self, asked: Mapping[str, Any]) -> str:
        """Equal for equal settings."""
        return json.dumps({**self.base.to_wire(), **asked}, sort_keys=True, default=list)

    def _values(self, found: Candidate, today: Candidate) -> tuple[float, float]:
        """What Optuna is told: of one that failed before it cost anything ten times today's."""
        cost = found.cost()
        return min(cost, 10 * today.cost()), self.trials.error(found)


def _between(value: float, end: float, one: Searched) -> float:
    """Half-way to an end of the range; a whole number where the setting wants one."""
    middle = math.sqrt(value * end) if isinstance(one.over, Log) else (value + end) / 2
    return round(middle) if one.whole else middle


def front(done: Sequence[Candidate], trials: Trials) -> list[Candidate]:
    """The candidates that none beats in both cost and error, the cheapest first."""
    found: list[Candidate] = []
    whole = [one for one in done if not one.ended and one.costs]
    for one in sorted(whole, key=lambda c: (c.cost(), trials.error(c))):
        if not found or trials.error(one) < trials.error(found[-1]):
            found.append(one)
    return found


def folder_name(parts: Sequence[object], word: str = "tune") -> str:
    """Of the run folder of a search: the same for the same search."""
    return file_name(f"{word}-" + "-".join(map(str, parts[:2])), *parts[2:])
