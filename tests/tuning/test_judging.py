"""Which candidate is taken, and what the other half says of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pytest_simbench.laws import LAWS
from pytest_simbench.measure.verdicts import at_least, at_most
from pytest_simbench.records.metrics import Metric
from pytest_simbench.tuning.judging import SEEDS, judged, recommended
from pytest_simbench.tuning.target import FAILED, Look, Target
from pytest_simbench.tuning.trials import Candidate
from tests.approval import assert_approved_message
from tests.records.build import failed, record

from .made_up import LANDED, target, trials


def candidate(errors: list[float], cost: float, of: Target, half: str = "held_out") -> Candidate:
    looks = of.judged if half else of.chosen
    known = dict(zip(looks, errors, strict=True))
    costs = {look: cost * (1 + k / 100) for k, look in enumerate(known)}
    return Candidate("made up", {}, half, errors=known, costs=costs)


LATE = Metric("late", "late", unit="s", better="lower", least=0)
LAWS_OF = tuple({law.phenomenon: Look(law) for law in LAWS}.values())[:3]
OF_LAWS = Target("laws:x", "cpu_cost", LAWS_OF, LAWS_OF)
KEPT = [0.5, 0.01, 0.01]


@pytest.mark.parametrize(
    ("of", "points", "wanted"),
    [
        (target(2), [(1.0, [0.0] * 2), (0.5, [0.04] * 2), (0.3, [0.3] * 2)], 1),  # five points
        (target(2), [(1.0, [0.0] * 2), (0.97, [0.0] * 2)], 0),  # no gain
        # truer, for up to twice the cost
        (target(1), [(1.0, [0.5]), (0.5, [0.5]), (2.0, [0.0]), (3.0, [0.0])], 2),
        (target(1), [(1.0, [0.5]), (9.0, [0.0])], 0),
        (OF_LAWS, [(1.0, KEPT), (0.5, [0.01, 0.01, 400.0])], 0),  # others do not make up for it
        (OF_LAWS, [(1.0, KEPT), (0.5, [1.0, 1.0, 1.0])], 1),
        # what failed widens no margin
        (replace(target(2), metric=LATE), [(1.0, [FAILED, 1.0]), (0.5, [FAILED, 3.0])], 0),
    ],
)
def test_the_cheapest_as_right_as_the_best(
    tmp_path: Path, of: Target, points: list[tuple[float, list[float]]], wanted: int
) -> None:
    looks, _ = trials(tmp_path, lambda s, k: 1.0, of)
    done = [candidate(errors, cost, of, "") for cost, errors in points]
    found, why = recommended(done, looks)
    assert done.index(found) == wanted
    assert_approved_message(why)


def test_margins() -> None:
    of = target()
    assert of.allowed(0.2) == pytest.approx(0.25)
    assert replace(of, metric=None).allowed(0.5) == 1.0  # a law that is kept
    assert replace(of, metric=None).allowed(20.0) == pytest.approx(22.0)


@pytest.mark.parametrize(
    ("before", "after", "verdict"),
    [
        ([0.0] * SEEDS, [0.0] * SEEDS, "not worse"),
        ([0.0] * (SEEDS - 1), [0.0] * (SEEDS - 1), "not shown"),  # one seed less
        ([0.0] * SEEDS, [1.0] * 30 + [0.0] * (SEEDS - 30), "worse"),
        ([1.0] * 30 + [0.0] * (SEEDS - 30), [0.0] * SEEDS, "better"),
        ([0.0] * SEEDS, [1.0] * 3 + [0.0] * (SEEDS - 3), "not shown"),
        ([0.3, 0.0, 0.0], [0.0, 0.1, 0.2], "not shown"),  # as wrong on the whole: by 0, no 2e-17
    ],
)
def test_verdicts_on_seeds(before: list[float], after: list[float], verdict: str) -> None:
    of = target(1, len(before))
    found = judged(candidate(before, 1.0, of), candidate(after, 0.5, of), of)
    assert found.verdict == verdict
    assert_approved_message(str(found))


@pytest.mark.parametrize(
    ("before", "after", "verdict"),
    [
        ([1.0] * 8, [1.0 - 1e-6 + k * 1e-9 for k in range(8)], "not worse"),  # it means nothing
        ([1.0] * 8, [1.0 - 5e-3 + k * 1e-9 for k in range(8)], "better"),
        ([1.0] * 8, [1.0] * 8, "not worse"),  # what every seed says
        ([1.0] * 8, [2.0] * 8, "worse"),
        ([1.0] * 2, [1.0] * 2, "not shown"),
        ([1.0] * 3, [1.0] * 3, "not worse"),
        ([FAILED, *[1.0] * 7], [FAILED, *[3.0] * 7], "worse"),  # it widens no margin
    ],
)
def test_verdicts_on_values(before: list[float], after: list[float], verdict: str) -> None:
    of = replace(target(1, len(before)), metric=LATE)
    found = judged(candidate(before, 1.0, of), candidate(after, 1.0, of), of)
    assert found.verdict == verdict
    assert_approved_message(str(found))


def test_the_cost_is_told_with_its_interval() -> None:
    of = target(1, 6)
    old, new = candidate([0.0] * 6, 1.0, of), candidate([0.0] * 6, 0.5, of)
    new.costs = {
        look: cost * (1 + (k % 2) / 50) for k, (look, cost) in enumerate(new.costs.items())
    }
    del old.costs[of.judged[4]], new.costs[of.judged[5]]  # which failed
    assert_approved_message(str(judged(old, new, of).cheaper))


def test_a_law_is_held_against_itself() -> None:
    two = Look(LAWS[0]), Look(LAWS[1])
    of = Target("laws:x", "cpu_cost", two, two)

    def verdict(before: Any, after: Any) -> str:
        found = judged(candidate(before, 1.0, of), candidate(after, 0.5, of), of)
        assert_approved_message(str(found))
        return found.verdict

    assert verdict([0.1, 8.0], [1.0, 8.5]) == "not worse"
    assert verdict([0.1, 0.1], [1.2, 5.0]) == "worse"  # the name is that of the worst
    assert verdict([0.1, 0.1], [5.0, 1.2]) == "worse"
    assert verdict([0.1, 8.0], [1.2, 0.5]) == "worse"  # one is broken now, whatever the other
    assert verdict([0.1, 8.0], [0.1, 0.5]) == "better"


PLACED, SOON = (LANDED, at_least(0.6)), (LATE, at_most(2.0))


@pytest.mark.parametrize(
    ("claim", "before", "after", "verdict"),
    [
        (PLACED, [0.0] * 20, [1.0] * 20, "better"),
        (PLACED, [1.0] * 20, [1.0] * 20, "not worse"),
        (PLACED, [1.0] * 20, [0.0] * 20, "worse"),
        (PLACED, [1.0] * 20, [1.0] * 10 + [0.0] * 10, "not shown"),
        (PLACED, [0.0] * 20, [0.0] * 20, "not shown"),
        (SOON, [1.0] * 20, [None] * 3 + [1.0] * 17, "not shown"),  # who fails has no time
    ],
)
def test_claims_are_judged_as_a_test_judges_them(
    claim: tuple[Metric, Any], before: list[float | None], after: list[float | None], verdict: str
) -> None:
    of = replace(target(1, 20), metric=None, claims=(claim,))

    def with_records(values: list[float | None], cost: float) -> Candidate:
        found = candidate([0.0] * 20, cost, of)
        for k, (look, value) in enumerate(zip(of.judged, values, strict=True)):
            one = failed(k) if value is None else record(metrics={claim[0].name: value})
            found.records[look], found.errors[look] = one, of.error(look, one, one)
        return found

    found = judged(with_records(before, 1.0), with_records(after, 0.5), of)
    assert found.verdict == verdict
    assert_approved_message(str(found))
    assert of.allowed(0.0) == 0.0  # who keeps them may not break them


def test_nothing_to_hold_them_against() -> None:
    of = target(1, 2)
    one = Candidate("today", {})
    assert_approved_message(str(judged(one, one, of)))
