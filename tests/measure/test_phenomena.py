"""Verdicts on planted truths: who is right is known, and the verdict says it and no more."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.measure.phenomena import BROKEN, KEPT, Miss, better, verdict, worst


def at(**ratios: float) -> dict[str, Miss]:
    """Laws that are missed so, with a tolerance of 1."""
    return {law: Miss(ratio, ratio) for law, ratio in ratios.items()}


RIGHT = at(x=0.1, y=0.9, z=0.5)
WRONG = at(x=0.1, y=40.0, z=0.5)
WRONG_ELSEWHERE = at(x=9.0, y=0.2, z=0.5)
FAILS = at(x=0.1, y=math.inf, z=0.5)
NEARER = at(x=0.05, y=0.45, z=0.25)
AT_THE_EDGE = at(x=0.1, y=1.9, z=0.5)
SMALLER_STEP = {**RIGHT, "y": Miss(3.0, 0.6)}


@pytest.mark.parametrize(
    ("found", "best", "unbeaten", "kept"),
    [
        ({"wrong": WRONG, "right": RIGHT, "fails": FAILS}, "right", "right", (2, 3, 2)),
        ({"one": RIGHT, "two": NEARER, "wrong": WRONG}, None, "one two", (3, 3, 2)),
        # Who is wrong about different laws is not compared by their number.
        ({"once": WRONG, "twice": {**WRONG_ELSEWHERE, **at(z=7.0)}}, None, "once twice", (2, 1)),
        # What is missed by less than two tolerances speaks against nobody.
        ({"right": RIGHT, "edge": AT_THE_EDGE}, None, "right edge", (3, 2)),
        ({"right": RIGHT, "broken": {**AT_THE_EDGE, **at(y=2.1)}}, "right", "right", (3, 2)),
        ({"one": WRONG, "two": WRONG}, None, "one two", (2, 2)),
        # The least wrong is the best though it breaks a law.
        ({"bad": {**WRONG, **at(z=8.0)}, "less": WRONG}, "less", "less", (1, 2)),
        # Who breaks a law by less than another one may miss it is no worse than that one.
        ({"coarse": RIGHT, "fine": SMALLER_STEP}, None, "coarse fine", (3, 2)),
        ({"alone": RIGHT}, None, "alone", (3,)),
    ],
)
def test_who_is_the_best_and_whom_nobody_beats(
    found: dict[str, dict[str, Miss]], best: str | None, unbeaten: str, kept: tuple[int, ...]
) -> None:
    assert KEPT < AT_THE_EDGE["y"].ratio < BROKEN
    told = verdict(found)
    assert (told.best, told.unbeaten) == (best, tuple(unbeaten.split()))
    assert told.kept == dict(zip(found, kept, strict=True))
    assert (told.laws, told.incomplete) == (3, ())
    half = verdict({"half": at(x=0.0), **found})  # who did not do all laws is not compared
    assert half == replace(told, incomplete=("half",))


def test_the_worst_law_is_what_counts() -> None:
    assert worst(WRONG) == 40.0
    assert worst(FAILS) == math.inf
    assert math.isnan(worst({}))


SIZES = st.sampled_from([0.5, 1.5, 3.0, math.inf])
MISSES = st.fixed_dictionaries(dict.fromkeys("abc", st.builds(Miss, SIZES, SIZES)))


@given(MISSES, MISSES)
def test_nobody_is_better_than_who_is_better(one: dict[str, Miss], two: dict[str, Miss]) -> None:
    assert not (better(one, two) and better(two, one))
    assert not better(one, one)


@given(st.dictionaries(st.sampled_from("pqrs"), MISSES, min_size=1))
def test_somebody_best_is_unbeaten_and_keeps_the_most(found: dict[str, dict[str, Miss]]) -> None:
    told = verdict(found)
    if told.best is not None:
        assert told.unbeaten == (told.best,)
        others = [found[who] for who in found if who != told.best]
        assert all(better(found[told.best], other) for other in others)


def test_the_limits_themselves_belong_to_the_milder_side() -> None:
    for beyond, kept, broken in ((0.0, True, False), (1e-9, False, True)):
        assert better(at(x=KEPT + beyond), at(x=9.0)) is kept
        assert better(at(x=0.0), at(x=BROKEN + beyond)) is broken
