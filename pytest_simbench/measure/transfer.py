"""Does one simulator rank policies as another one does? From the success of each policy on each
simulator with the same seeds; a crashed repetition is no success.

- tau-b (Kendall 1945, Biometrika 33): 1 for the same order, -1 for the reverse; undefined where a
  simulator ties all policies.
- MMRV, mean maximum rank violation (Li et al. 2024, Evaluating Real-World Robot Manipulation
  Policies in Simulation): how much success in the reference the worst wrong order of a policy
  costs, mean of the policies; ties as in the code of its authors.
- Intervals of both: percentiles of what resampled seeds give. They hold what so many seeds give on
  average (97 times in 100 or more), which is nearer to 0 than tau-b of the true rates: of 20 seeds
  two equal engines have 0.65 in place of 1. So tau-b is read beside the ceiling.
- Whether ranks differ: two simulators that order two policies differently contradict each other by
  the smaller of the differences (as in Gail and Simon 1985, Testing for qualitative interactions,
  Biometrics 41). A permutation test of the largest contradiction exchanges the simulators seed by
  seed. Equal ranks are called different in 2 to 5 of 100 runs, also where one simulator succeeds
  less with every policy; more often where it tells them apart four times worse: 6 with 20 seeds, 12
  with 60 or 140, 46 with 400.

**The ceiling** is a simulator against itself: two runs of as many seeds. Halves of the seeds have
twice the noise, and success as it was seen is more spread than in truth. So the rates are pulled
together until their variance is what it is without noise (Kelley's formula, with the noise of the
differences of policies), and two runs are drawn around them with resampled seeds. The mean of 100
experiments of 20 seeds; a single one is off by 0.2 (deviation):

    policies succeed in        truth   this   rates as seen   halves
    5: 60 to 95 %               0.65   0.60            0.70     0.53
    the same and one in 0 %     0.77   0.79            0.79     0.68
    8: 60 to 95 %               0.56   0.49            0.61     0.38
    4: 70 to 80 %               0.13   0.14            0.40     0.02
    3: 20, 50 and 80 %          0.96   0.86            0.87     0.84
    5: 80 %                     0.00   0.13            0.40     0.00
    3 in 30 %, 3 in 90 %        0.65   0.77            0.77     0.65

It errs by up to 0.13: too high of rates that are equal, too low of those that are far apart.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.measure.comparison import ALPHA, holm
from pytest_simbench.measure.intervals import CONFIDENCE, FEWEST, SEED, Interval
from pytest_simbench.records.configuration import TASK, text
from pytest_simbench.records.record import Record, plain
from pytest_simbench.records.series import Configured, RowKey, configured, grouped

METRIC, POLICY = "success", f"{TASK}policy"
"""The metric, and the parameter of the task that names the policy. Others of a policy begin with
`task.policy` too."""

DIGEST = f"{POLICY}_digest"
"""What tells apart two policies of one name."""

DRAWS = 1999
"""Of every resampling; pairs of eight simulators are told apart with so many."""

NARROW = 0.2
"""A ceiling's interval that is no wider tells rankings."""

MOST = 10_000
"""Seeds beyond which no number is told."""

Array = NDArray[np.float64]
Verdict = Literal["alike", "different", "open", "undefined"]


def tau_b(first: Array, second: Array) -> Array:
    """Of success (..., policies), in numbers whose ties are exact; nan where one side is all ties.
    scipy's takes one pair at a time."""
    a, b = map(np.sign, _differences(first, second))
    ties = np.sqrt((a * a).sum(-1) * (b * b).sum(-1))
    return np.where(ties > 0, (a * b).sum(-1) / np.maximum(ties, 1), np.nan)


def mmrv(rates: Array, reference: Array) -> Array:
    """Of rates (..., policies) in a simulator and in the reference."""
    a, b = (side[..., :, None] - side[..., None, :] for side in (rates, reference))
    worst: Array = np.where((a > 0) != (b > 0), np.abs(b), 0.0).max(-1)
    return np.asarray(worst.mean(-1))


def contradictions(first: Array, second: Array) -> Array:
    """Of success (..., policies): by how much two policies are ordered differently (..., pairs)."""
    a, b = _differences(first, second)
    return np.where(a * b < 0, np.minimum(np.abs(a), np.abs(b)), 0.0)


def _differences(*sides: Array) -> list[Array]:
    """Of each two policies, as `itertools.combinations` has them."""
    i, j = np.triu_indices(sides[0].shape[-1], 1)
    return [side[..., i] - side[..., j] for side in sides]


def two_runs(outcomes: Array, seeds: int) -> tuple[Array, Array]:
    """Successes of each policy in two independent runs of so many seeds, each (draws, policies),
    from outcomes (policies, seeds); see the module."""
    n, rates, rng = outcomes.shape[1], outcomes.mean(1), np.random.default_rng(SEED)
    noise = _differences(outcomes.T)[0].var(0, ddof=1).mean() / (2 * n)
    spread = rates.var(ddof=1)
    pull = math.sqrt(max(0.0, 1 - noise / spread)) if spread else 0.0
    away = (pull - 1) * (rates - rates.mean())
    kinds, often = np.unique(outcomes, axis=1, return_counts=True)  # equal seeds are drawn together
    drawn = (rng.multinomial(seeds, often / n, DRAWS) @ kinds.T / seeds for _ in range(2))
    first, second = (np.round(seeds * np.clip(run + away, 0, 1)) for run in drawn)
    return first, second


@dataclass(frozen=True)
class Ceiling:
    """A simulator against itself on other seeds, from outcomes (policies, seeds)."""

    outcomes: Array

    @cached_property
    def tau(self) -> Interval:
        return self.tau_with(self.outcomes.shape[1])

    @cached_property
    def mmrv(self) -> Interval:
        n = self.outcomes.shape[1]
        first, second = two_runs(self.outcomes, n)
        return _interval(mmrv(first / n, second / n), n)

    def tau_with(self, seeds: int) -> Interval:
        """With so many seeds, where policies succeed as often as here."""
        return _interval(tau_b(*two_runs(self.outcomes, seeds)), seeds)

    @cached_property
    def needed(self) -> int | None:
        """About how many seeds make it narrow; None above `MOST`."""
        low = high = int(self.outcomes.shape[1])
        while not narrow(self.tau_with(high)):
            low, high = high, 2 * high
            if high > MOST:
                return None
        while high - low > high / 20:
            middle = (low + high) // 2
            low, high = (low, middle) if narrow(self.tau_with(middle)) else (middle, high)
        return high


@dataclass(frozen=True)
class Pair:
    """Two simulators: tau-b; how likely so large a contradiction is where they rank alike, adjusted
    for all pairs (Holm); and the two policies of the largest one, by their places."""

    tau: Interval
    p_value: float
    crossed: tuple[int, int]


@dataclass(frozen=True)
class Transfer:
    """Policies on simulators.

    Attributes:
        outcomes: (simulators, policies, seeds), 1 for success; at least `FEWEST` seeds.
        left_out: simulators that lack a policy.
        lone: policies that too few simulators have.
    """

    task: str
    policies: Sequence[str]
    simulators: Sequence[Configured]
    outcomes: Array
    left_out: Sequence[Configured] = ()
    lone: Sequence[str] = ()

    @property
    def seeds(self) -> int:
        return int(self.outcomes.shape[-1])

    @cached_property
    def ceilings(self) -> list[Ceiling]:
        return list(map(Ceiling, self.outcomes))

    @cached_property
    def _sums(self) -> tuple[Array, Array]:
        """Successes (simulators, policies), and those of resampled seeds, with draws between."""
        n = self.seeds
        weights = np.random.default_rng(SEED).multinomial(n, [1 / n] * n, DRAWS)
        return self.outcomes.sum(-1), np.moveaxis(self.outcomes @ weights.T, -1, 1)

    @cached_property
    def pairs(self) -> dict[tuple[int, int], Pair]:
        """By the places of the simulators."""
        sums, drawn = self._sums
        inside = list(combinations(range(len(self.policies)), 2))
        places = list(combinations(range(len(self.simulators)), 2))
        p_values = holm([_p_value(self.outcomes[i], self.outcomes[j]) for i, j in places])
        return {
            (i, j): Pair(
                _interval(tau_b(drawn[i], drawn[j]), self.seeds, float(tau_b(sums[i], sums[j]))),
                p_value,
                inside[int(contradictions(sums[i], sums[j]).argmax())],
            )
            for (i, j), p_value in zip(places, p_values, strict=True)
        }

    def tau(self, first: int, second: int) -> Interval:
        """tau-b of two simulators, or the ceiling of one."""
        if first == second:
            return self.ceilings[first].tau
        return self.pairs[min(first, second), max(first, second)].tau

    def mmrv(self, first: int, reference: int) -> Interval:
        """MMRV of a simulator by another one, or by itself on other seeds."""
        if first == reference:
            return self.ceilings[first].mmrv
        (sums, drawn), n = self._sums, self.seeds
        seen = float(mmrv(sums[first] / n, sums[reference] / n))
        return _interval(mmrv(drawn[first] / n, drawn[reference] / n), n, seen)

    def verdict(self, first: int, second: int) -> Verdict:
        """`different`: ranks differ by more than the noise. `alike`: tau-b lies within two narrow
        ceilings, or wholly above their means, where outcomes are nearly equal seed by seed."""
        pair, both = self.pairs[first, second], [self.ceilings[k].tau for k in (first, second)]
        if math.isnan(pair.tau.mean):
            return "undefined"
        if pair.p_value <= ALPHA:
            return "different"
        within = all(narrow(one) and pair.tau.mean >= one.low for one in both)
        return "alike" if within or all(pair.tau.low >= one.mean for one in both) else "open"


def _p_value(first: Array, second: Array) -> float:
    """Of outcomes (policies, seeds)."""
    sides = first.sum(1), second.sum(1)
    swapped = np.random.default_rng(SEED).integers(0, 2, (DRAWS, first.shape[1]))
    moved = swapped @ (second - first).T
    drawn = contradictions(sides[0] + moved, sides[1] - moved).max(1)
    return (1 + int((drawn >= contradictions(*sides).max()).sum())) / (1 + DRAWS)


def _interval(drawn: Array, n: int, mean: float | None = None) -> Interval:
    """What was drawn as an interval, of the draws' mean where there is no other. Draws without a
    tau-b are left out."""
    known = drawn[~np.isnan(drawn)]
    if not known.size or (mean is not None and math.isnan(mean)):
        return Interval(math.nan, -math.inf, math.inf, n, "none")
    low, high = np.quantile(known, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2]).tolist()
    return Interval(float(known.mean()) if mean is None else mean, low, high, n, "percentiles")


def narrow(found: Interval) -> bool:
    """Whether a ceiling tells rankings; so does 0.8 to 1, one pair of five policies."""
    return 2 * found.half_width <= NARROW + 1e-9


def transfers(records: Iterable[Record]) -> list[Transfer]:
    """Of each task that policies do: those of two policies and two configurations at least."""
    own = [r for r in records if POLICY in r.settings and not r.swept]
    own.sort(key=lambda r: RowKey.of(r).order)
    return [found for group in grouped(own, _work).values() if (found := _transfer(group))]


def _work(record: Record) -> tuple[Any, ...]:
    """What policies were asked for."""
    mine = {k: plain(v) for k, v in record.settings.items() if k.startswith(TASK)}
    same = {k: v for k, v in mine.items() if not k.startswith(POLICY)}
    return record.task, text(same), record.robot.get("name"), record.jitter


def _policy(record: Record) -> tuple[Any, Any]:
    """Its name, and what tells apart two of one name."""
    return record.settings[POLICY], record.settings.get(DIGEST)


def _transfer(records: Sequence[Record]) -> Transfer | None:
    """Policies come in the order of their success in all simulators."""
    found: dict[Configured, dict[str, dict[int, float]]] = {}
    twice = Counter(name for name, _ in set(map(_policy, records)))
    told = [(who, r) for who, own in configured(records, _policy).items() for r in own]
    for who, r in told:
        value = 0.0 if r.status == "failed" else r.metrics.get(METRIC)
        if r.status != "interrupted" and value is not None:
            of = found.setdefault(who, {})
            name = str(r.settings[POLICY])
            name += f" {str(r.settings.get(DIGEST))[:6]}" if twice[name] > 1 else ""
            of.setdefault(name, {})[r.seed] = float(value)
    have = {who: {p for p in of if len(of[p]) >= FEWEST} for who, of in found.items()}
    sharing = [(own, [who for who in have if own <= have[who]]) for own in have.values()]
    # The most that two simulators have.
    own, whole = max(sharing, key=lambda of: (len(of[1]) > 1, *map(len, of)), default=(set(), []))
    policies = sorted(own)
    every = [found[who][policy].keys() for who in whole for policy in policies]
    seeds = sorted(frozenset(every[0]).intersection(*every[1:])) if every else []
    if len(whole) < 2 or len(policies) < 2 or len(seeds) < FEWEST:
        return None
    outcomes = np.array([[[found[w][p][s] for s in seeds] for p in policies] for w in whole])
    order = np.argsort(-outcomes.sum((0, 2)), kind="stable")
    left_out = [who for who in found if who not in whole]
    lone = sorted({policy for of in found.values() for policy in of} - own)
    known = [policies[k] for k in order]
    return Transfer(records[0].task, known, whole, outcomes[:, order], left_out, lone)
