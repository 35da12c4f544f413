"""The search: Optuna proposes settings, repetitions tell cost and error.

The trials of a search come one after the other from one process. Each has a sampler of its own,
seeded by the search's seed and its number, so that a search that was interrupted comes by the same
trials again; what is recorded it does not repeat, and then goes on as it would have. It keeps no
journal, which torn or locked would end it."""

from __future__ import annotations

import json
import math
import time
import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pytest_simbench.ground.names import file_name
from pytest_simbench.simulator.settings import Linear, Log, Searched, Settings, changes, searched
from pytest_simbench.tuning.judging import recommended
from pytest_simbench.tuning.steps import TRIES, acts, between, corners, near, own_values
from pytest_simbench.tuning.target import FAILED, TuningError
from pytest_simbench.tuning.trials import Candidate, Trials

STARTUP = 10
"""Trials before the sampler learns from them."""

IDLE = 100
"""Trials in a row that bring only what was looked at, after which a search ends."""


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
        tell: takes each candidate that ended, with the front until then.
    """

    trials: Trials
    base: Settings
    space: Sequence[Searched]
    seed: int
    tell: Callable[[Candidate, Sequence[Candidate]], None]
    done: list[Candidate] = field(default_factory=list)

    def run(self, seconds: float, most: int | None = None) -> list[Candidate]:
        """Search for so long, or until there are so many trials, those of an earlier call count, or
        no new values come. The first of the candidates are today's settings.

        Raises:
            TuningError: no Optuna, nothing that runs, or too little time.
        """
        library = optuna()
        began = time.monotonic()
        today = self.trials.today(seconds if most is None else math.inf)
        self.done = [today]
        study = self._study(library)
        known, number, latest = {self._key({}): today}, 0, 0
        while number != most and number - latest < IDLE:
            if time.monotonic() - began + self.trials.runs.spent >= seconds:
                break
            if number % 2 and number == len(study.trials):
                study.enqueue_trial(self._step(number, known))
            trial = self._trial(library, study, number)
            asked = changes(self._suggested(trial), self.base)
            key = self._key(asked)
            if key not in known:
                known[key] = self.trials.choose(f"trial{number}", asked, self.done)
                self.done.append(known[key])
                self.tell(known[key], front(self.done, self.trials))
                latest = number
            cost = min(known[key].cost(), 10 * today.cost())  # also of one that failed at once
            study.tell(trial, (cost, self.trials.error(known[key])))
            number += 1
        return self.done

    def _study(self, library: Any) -> Any:
        study = library.create_study(directions=["minimize", "minimize"])
        for values in self._first():
            study.enqueue_trial(values)
        return study

    def _trial(self, library: Any, study: Any, number: int) -> Any:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # group is experimental
            study.sampler = library.samplers.TPESampler(
                seed=self.seed * 1_000_003 + number, multivariate=True, group=True,
                n_startup_trials=STARTUP,
            )  # fmt: skip
        return study.ask()

    def _suggested(self, trial: Any) -> dict[str, Any]:
        """Values for a trial. Of what does not act with the others' values none is asked for."""
        found: dict[str, Any] = {}
        settings = dict(vars(self.base))
        for one in self.space:
            if not acts(one, settings):
                continue
            value = self._one(trial, one)
            found[one.name] = settings[one.setting] = value
        return found

    def _one(self, trial: Any, one: Searched) -> Any:
        if not isinstance(one.over, Linear):
            return trial.suggest_categorical(one.name, list(one.over))
        log = isinstance(one.over, Log)
        if one.whole:
            return trial.suggest_int(one.name, int(one.over.low), int(one.over.high), log=log)
        value = f"{trial.suggest_float(one.name, one.over.low, one.over.high, log=log):.4g}"
        own = own_values(self.space, self.base).get(one.name)  # 1/240 as it is
        if own is not None and f"{own:.4g}" == value:
            return own
        if one.name == "timestep" and (period := self.trials.target.period):
            return period / max(1, round(period / float(value)))
        return float(value)

    def _first(self) -> list[dict[str, Any]]:
        """Today's values, and each with one changed: half-way to either end of its range on its
        scale, or another choice. Most settings that are drawn at random do not work at all."""
        own = own_values(self.space, self.base)
        found = [own]
        for one in self.space:
            if one.name not in own:
                continue
            others = near(own, one)
            if not isinstance(one.over, tuple):
                others = [between(own[one.name], end, one) for end in (one.over.high, one.over.low)]
            found += [{**own, one.name: value} for value in others if value != own[one.name]]
        return found

    def _step(self, number: int, known: Collection[str]) -> dict[str, Any]:
        """Values where Optuna's sampler hardly comes: in turns those of the point that would be
        recommended now, of the truest and of any of the front, each with a choice, or with
        one or two settings changed to an end of the range or a part of the way there; and then of
        the corners of all ranges a row in which pairs of settings meet as they have not yet."""
        rng, turn = np.random.default_rng([self.seed, number]), number // 2
        best = front(self.done, self.trials)
        if turn % 4 == 3:
            rows = corners(self.space, np.random.default_rng(self.seed))
            return rows[turn // 4 % len(rows)]
        first = (recommended(self.done, self.trials)[0], best[-1], best[rng.integers(len(best))])
        point = first[turn % 4]
        own = own_values(self.space, self.base, point.changes)
        settings = {**vars(self.base), **point.changes}
        acting = [one for one in self.space if acts(one, settings)]
        choices = [one for one in acting if not isinstance(one.over, Linear)]
        for kind in rng.permutation(3):
            among, many = ((choices, 1), (acting, 1), (acting, 2))[kind]
            for _ in range(TRIES if among else 0):
                values = dict(own)
                for one in rng.permutation(np.array(among, object))[:many]:
                    other = near(own, one)
                    values[one.name] = other[rng.integers(len(other))]
                if self._key(changes(values, self.base)) not in known:
                    return values
        return own

    def _key(self, asked: Mapping[str, Any]) -> str:
        """Equal for equal settings."""
        return json.dumps({**self.base.to_wire(), **asked}, sort_keys=True, default=list)


def finished(done: Sequence[Candidate]) -> list[Candidate]:
    """Those that were looked at to the end; without those that lack an error on some seed, unless
    all do."""
    whole = [one for one in done if not one.ended and one.costs]
    return [one for one in whole if FAILED not in one.errors.values()] or whole


def front(done: Sequence[Candidate], trials: Trials) -> list[Candidate]:
    """The finished candidates that none beats in both cost and error, the cheapest first."""
    found: list[Candidate] = []
    for one in sorted(finished(done), key=lambda c: (c.cost(), trials.error(c))):
        if not found or trials.error(one) < trials.error(found[-1]):
            found.append(one)
    return found


def folder_name(parts: Sequence[object], word: str = "tune") -> str:
    """Of the run folder of a search: the same for the same search."""
    return file_name(f"{word}-" + "-".join(map(str, parts[:2])), *parts[2:])
