"""Which candidate is recommended, and the verdict on the half that it was not chosen on."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from pytest_simbench.measure.intervals import Interval, betting, interval, proportion, skewed_t
from pytest_simbench.measure.verdicts import Verdict, confidence, judge
from pytest_simbench.records.metrics import significant
from pytest_simbench.tuning.target import MARGIN, Look, Target
from pytest_simbench.tuning.trials import Candidate, Trials, least_costs

DEARER = 2.0
"""Times today's cost that the recommended point may have."""

WORTH = 0.95
"""A cost of more than this of today's is no gain."""

SEEDS = 72
"""Seeds without a loss that bound it below 5 points, with an error of 2.5 %; the other 2.5 % are
for the bets."""


def recommended(done: Sequence[Candidate], trials: Trials) -> tuple[Candidate, str]:
    """The candidate to take, today's if it is that, and why."""
    today, target = done[0], trials.target
    within = [c for c in done if not c.ended and c.cost() <= DEARER * today.cost()]
    errors = [target.together(c.errors, least=1.0) for c in within]
    best = min(errors)
    limit = best + target.margin(within[errors.index(best)].errors)
    right = [c for c, error in zip(within, errors, strict=True) if error <= limit]
    found = min(right, key=lambda c: c.cost())
    if found is today or (today in right and found.cost() > WORTH * today.cost()):
        return today, "no cheaper candidate has an error that is not worse"
    return found, (
        f"the cheapest of {len(right)} whose error is not worse than the least, "
        f"{significant(best)}, that {DEARER:g} times today's cost buy (margin: up to "
        f"{significant(limit)})"
    )


@dataclass(frozen=True)
class Judgement:
    """What the held-out half says of a candidate beside today's settings.

    Attributes:
        verdict: `better`, `not worse`, `worse` or `not shown`.
        worse_by: by how much the error is larger, with its interval; None of laws and claims.
        cheaper: today's cost over the candidate's, with its interval; None where too few.
        several: of each target of several, by its name.
    """

    verdict: str
    before: float
    after: float
    worse_by: Interval | None
    cheaper: Interval | None
    reason: str
    several: Mapping[str, Judgement] = field(default_factory=dict, repr=False)


def judged(today: Candidate, found: Candidate, target: Target) -> Judgement:
    """The verdict from the looks that both have had on the held-out half."""
    if len(target.parts) > 1:
        several = {part.name: judged(today, found, part) for part in target.parts}
        verdicts = [one.verdict for one in several.values()]
        worst = next(v for v in ("worse", "not shown", "better", "not worse") if v in verdicts)
        after = target.beside(today.errors).together(found.errors)
        return Judgement(worst, 0.0, after, None, None, "", several)
    looks = [look for look in target.judged if look in today.errors and look in found.errors]
    if target.laws:
        looks = [look for look in looks if look.number == 1]
    if not looks:
        return Judgement("not shown", math.nan, math.nan, None, None, "nothing tells what is right")
    before = target.together({look: today.errors[look] for look in looks})
    after = target.together({look: found.errors[look] for look in looks})
    old, new = least_costs(today.costs), least_costs(found.costs)
    costs = [
        math.log(old[look] / new[look])
        for look in looks
        if min(old.get(look, 0.0), new.get(look, 0.0)) > 0
    ]
    cheaper = None
    if len(costs) >= 3 and max(costs) > min(costs):
        of = skewed_t(costs)
        mean, low, high = (math.exp(value) for value in (of.mean, of.low, of.high))
        cheaper = Interval(mean, low, high, of.n, of.method)
    if target.metric is None:
        verdict, reason = (_of_laws if target.laws else _of_claims)(target, looks, today, found)
        return Judgement(verdict, before, after, None, cheaper, reason)
    more = [found.errors[look] - today.errors[look] for look in looks]
    bound = _difference(more, target.metric.bounded)
    margin = target.margin({look: today.errors[look] for look in looks})
    verdict, reason = _of_seeds(bound, margin, target.metric.smallest_difference, more)
    return Judgement(verdict, before, after, bound, cheaper, reason)


def _of_laws(
    target: Target, looks: Sequence[Look], today: Candidate, found: Candidate
) -> tuple[str, str]:
    """Laws draw nothing, so there is no interval: each one is held against itself."""
    worse = {
        look.task.name: found.errors[look] / today.errors[look]
        for look in looks
        if found.errors[look] > target.allowed(today.errors[look])
    }
    if worse:
        name = max(worse, key=lambda key: worse[key])
        return "worse", (
            f"{len(worse)} of {len(looks)} laws at other parameters, {name} "
            f"{significant(worse[name])} times"
        )
    better = any(today.errors[look] > target.allowed(found.errors[look]) for look in looks)
    verdict = "better" if better else "not worse"
    return verdict, (
        f"each of {len(looks)} laws at other parameters is kept, or broken by at most "
        f"{100 * MARGIN:.0f} % more than today"
    )


def _of_claims(
    target: Target, looks: Sequence[Look], today: Candidate, found: Candidate
) -> tuple[str, str]:
    """Each claim is judged as a test of pytest judges it, on either's repetitions."""
    verdicts, told = [], []
    for metric, claim in target.claims:
        pair = []
        for one in (today, found):
            known = (one.records[look].value(metric) for look in looks)
            values = [value for value in known if value is not None]
            pair.append(judge(claim, interval(values, metric, confidence(metric))))
        old, new = pair
        verdicts.append((old.verdict, new.verdict))
        told.append(
            f"{metric.name} {claim}: {new.verdict} ({significant(new.interval.mean)}), today "
            f"{old.verdict} ({significant(old.interval.mean)})"
        )
    reason = f"{'; '.join(told)}; {len(looks)} seeds, of which {found.failed} failed"
    if any(new is Verdict.REFUTED and old is not new for old, new in verdicts):
        return "worse", reason
    lost = found.failed > today.failed  # a length or a time of what failed is none
    if lost or any(new is not Verdict.SUPPORTED for _, new in verdicts):
        return "not shown", reason
    refuted = any(old is Verdict.REFUTED for old, _ in verdicts)
    return "better" if refuted else "not worse", reason


def _difference(more: Sequence[float], bounded: bool) -> Interval:
    """By how much errors are larger, for each seed. Of proportions the upper end is the lower of
    two, each wrong in 2.5 % at most: that of bets, and how often a seed can be worse at all."""
    n, mean = len(more), round(sum(more) / len(more), 12)  # 0.3 - 0.1 - 0.2 is 0, no -3e-17
    if bounded:
        bets = betting([(d + 1) / 2 for d in more])
        losses = proportion(sum(d > 0 for d in more), n)
        return Interval(mean, 2 * bets.low - 1, min(2 * bets.high - 1, losses.high), n, "betting")
    if n < 3:
        return Interval(mean, -math.inf, math.inf, n, "none")
    return skewed_t(more) if max(more) > min(more) else Interval(mean, mean, mean, n, "constant")


def _of_seeds(
    bound: Interval, margin: float, least: float, more: Sequence[float]
) -> tuple[str, str]:
    """Less than `least` means nothing, however certain."""
    lost = sum(d > 0 for d in more)
    told = f"worse in {lost} of {bound.n} seeds; margin {significant(margin)}"
    if bound.high < -least:
        return "better", told
    if bound.high <= margin:
        return "not worse", told
    if bound.low > 0:
        return "worse", told
    enough = f" (with no loss {SEEDS} are enough)" if bound.method == "betting" else ""
    return "not shown", f"{told}; too few seeds to tell{enough}"
