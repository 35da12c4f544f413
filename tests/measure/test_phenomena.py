"""Verdicts on planted truths: who is right is known, and the verdict says it and no more."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.measure.phenomena import BROKEN, KEPT, better, verdict, worst

RIGHT = {"x": 0.1, "y": 0.9, "z": 0.5}
WRONG = {"x": 0.1, "y": 40.0, "z": 0.5}
WRONG_ELSEWHERE = {"x": 9.0, "y": 0.2, "z": 0.5}
FAILS = {"x": 0.1, "y": math.inf, "z": 0.5}
NEARER = {law: ratio / 2 for law, ratio in RIGHT.items()}
AT_THE_EDGE = {"x": 0.1, "y": 1.9, "z": 0.5}


@pytest.mark.parametrize(
    ("found", "best", "unbeaten", "kept"),
    [
        ({"wrong": WRONG, "right": RIGHT, "fails": FAILS}, "right", "right", (2, 3, 2)),
        ({"one": RIGHT, "two": NEARER, "wrong": WRONG}, None, "one two", (3, 3, 2)),
        # Who is wrong about different laws is not compared by their number.
        ({"once": WRONG, "twice": {**WRONG_ELSEWHERE, "z": 7.0}}, None, "once twice", (2, 1)),
        # What is missed by less than two tolerances speaks against nobody.
        ({"right": RIGHT, "edge": AT_THE_EDGE}, None, "right edge", (3, 2)),
        ({"right": RIGHT, "broken": {**AT_THE_EDGE, "y": 2.1}}, "right", "right", (3, 2)),
        ({"one": WRONG, "two": WRONG}, None, "one two", (2, 2)),
        # The least wrong is the best though it breaks a law.
        ({"bad": {**WRONG, "z": 8.0}, "less": WRONG}, "less", "less", (1, 2)),
        ({"alone": RIGHT}, None, "alone", (3,)),
    ],
)
def test_who_is_the_best_and_whom_nobody_beats(
    found: dict[str, dict[str, float]], best: str | None, unbeaten: str, kept: tuple[int, ...]
) -> None:
    assert KEPT < AT_THE_EDGE["y"] < BROKEN
    told = verdict(found)
    assert (told.best, told.unbeaten) == (best, tuple(unbeaten.split()))
    assert told.kept == dict(zip(found, kept, strict=True))
    assert (told.laws, told.incomplete) == (3, ())
    half = verdict({"half": {"x": 0.0}, **found})  # who did not do all laws is not compared
    assert half == replace(told, incomplete=("half",))


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


def test_the_limits_themselves_belong_to_the_milder_side() -> None:
    for beyond, kept, broken in ((0.0, True, False), (1e-9, False, True)):
        assert better({"x": KEPT + beyond}, {"x": 9.0}) is kept
        assert better({"x": 0.0}, {"x": BROKEN + beyond}) is broken
