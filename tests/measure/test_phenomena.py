"""Verdicts on planted truths: who is right is known, and the verdict says it and no more."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.measure.phenomena import BROKEN, KEPT, better, verdict, worst

RIGHT = {"x": 0.1, "y": 0.9, "z": 0.5}
WRONG = {"x": 0.1, "y": 40.0, "z": 0.5}
WRONG_ELSEWHERE = {"x": 9.0, "y": 0.2, "z": 0.5}
FAILS = {"x": 0.1, "y": math.inf, "z": 0.5}
AT_THE_EDGE = {"x": 0.1, "y": 1.9, "z": 0.5}


def test_the_only_one_that_is_right_is_the_best() -> None:
    found = verdict({"wrong": WRONG, "right": RIGHT, "fails": FAILS})
    assert (found.best, found.unbeaten) == ("right", ("right",))
    assert found.kept == {"wrong": 2, "right": 3, "fails": 2}
    assert (found.laws, found.incomplete) == (3, ())


def test_of_two_that_are_right_none_is_the_best() -> None:
    found = verdict({"one": RIGHT, "two": {k: v / 2 for k, v in RIGHT.items()}, "wrong": WRONG})
    assert (found.best, found.unbeaten) == (None, ("one", "two"))


def test_who_is_wrong_about_different_laws_is_not_compared_by_their_number() -> None:
    twice = {**WRONG_ELSEWHERE, "z": 7.0}
    found = verdict({"once": WRONG, "twice": twice})
    assert (found.best, found.unbeaten) == (None, ("once", "twice"))
    assert found.kept == {"once": 2, "twice": 1}


def test_what_is_missed_by_less_than_two_tolerances_speaks_against_nobody() -> None:
    assert KEPT < AT_THE_EDGE["y"] < BROKEN
    found = verdict({"right": RIGHT, "edge": AT_THE_EDGE})
    assert (found.best, found.unbeaten) == (None, ("right", "edge"))
    assert verdict({"right": RIGHT, "broken": {**AT_THE_EDGE, "y": 2.1}}).best == "right"


def test_all_wrong_alike_and_nobody_is_the_best() -> None:
    assert verdict({"one": WRONG, "two": WRONG}).best is None


def test_the_least_wrong_is_the_best_though_it_breaks_a_law() -> None:
    assert verdict({"bad": {**WRONG, "z": 8.0}, "less": WRONG}).best == "less"


def test_one_alone_is_not_the_best() -> None:
    assert verdict({"alone": RIGHT}).best is None


def test_who_did_not_do_all_laws_is_not_compared() -> None:
    found = verdict({"right": RIGHT, "half": {"x": 0.0}, "wrong": WRONG})
    assert (found.best, found.incomplete) == ("right", ("half",))
    assert "half" not in found.kept


def test_the_worst_law_is_what_counts() -> None:
    assert worst(WRONG) == 40.0
    assert worst(FAILS) == math.inf
    assert math.isnan(worst({}))


RATIOS = st.fixed_dictionaries(dict.fromkeys("abc", st.sampled_from([0.5, 1.5, 3.0, math.inf])))


@given(RATIOS, RATIOS)
def test_nobody_is_better_than_who_is_better(one: dict[str, float], two: dict[str, float]) -> None:
    assert not (better(one, two) and better(two, one))
    assert not better(one, one)


@given(st.dictionaries(st.sampled_from("pqrs"), RATIOS, min_size=1))
def test_somebody_best_is_unbeaten_and_keeps_the_most(found: dict[str, dict[str, float]]) -> None:
    told = verdict(found)
    if told.best is not None:
        assert told.unbeaten == (told.best,)
        others = [found[who] for who in found if who != told.best]
        assert all(better(found[told.best], other) for other in others)


@pytest.mark.parametrize("limit", [KEPT, BROKEN])
def test_the_limits_themselves_belong_to_the_milder_side(limit: float) -> None:
    at, above = {"x": limit}, {"x": limit + 1e-9}
    rival = {"x": 9.0} if limit == KEPT else {"x": 0.0}
    if limit == KEPT:
        assert better(at, rival)
        assert not better(above, rival)
    else:
        assert not better(rival, at)
        assert better(rival, above)
