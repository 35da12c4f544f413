"""What is tuned for, and the two halves."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from pytest_simbench.data import Toss, Tosses
from pytest_simbench.laws import LAWS, Law
from pytest_simbench.laws.base import OTHER, held_out
from pytest_simbench.measure.verdicts import at_least, at_most
from pytest_simbench.records.metrics import Metric
from pytest_simbench.scene import Pose, Scene, Start
from pytest_simbench.tasks import Replaying, Settling, Tossing
from pytest_simbench.tasks.base import cube
from pytest_simbench.tuning import target as module
from pytest_simbench.tuning.target import (
    FAILED,
    FIRST_CHOSEN,
    FIRST_JUDGED,
    TIMES,
    Look,
    TuningError,
    target,
)
from tests.records.build import record
from tests.tasks.scripted_scene import SCENE
from tests.tasks.test_replaying import log_of
from tests.tiny import WHITE, Falling

from .made_up import LANDED
from .made_up import target as of_falling


def test_laws_are_judged_at_other_parameters() -> None:
    found = target("laws:sticking,grip_holds", "cpu_cost", None, 4, 9)
    names = {law.name for law in LAWS if law.phenomenon == "sticking"} | {"grip_holds"}
    assert {look.task.name for look in found.chosen} == names
    assert len(found.chosen) == len(TIMES) * len(names)
    assert not {*found.chosen} & {*found.judged}
    assert {look.task.name for look in found.judged} <= {look.task.name for look in found.chosen}
    assert OTHER.keys() <= {law.name for law in LAWS}


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_a_law_at_other_parameters_is_another(law: Law) -> None:
    other = held_out(law)
    assert (other is None) == (law.name not in OTHER)
    if other is not None:
        assert other != law
        other.build()


def test_a_task_has_seeds() -> None:
    found = target("stacking", "cpu_cost", None, 4, 9)
    assert [look.number for look in found.chosen] == [1, 2, 3, 4]
    assert (len(found.judged), found.metric and found.metric.name) == (9, "at_end")


def test_laws_count_by_phenomenon() -> None:
    """The worst of a phenomenon; of several the geometric mean."""
    laws = {law.name: Look(law) for law in LAWS}
    looks = tuple(laws[name] for name in ("creep", "carried", "grip_holds"))
    of = replace(of_falling(), metric=None, chosen=looks)
    assert of.together(dict(zip(looks, (1.0, 4.0, 9.0), strict=True))) == pytest.approx(6.0)


def test_shares_are_what_is_missing() -> None:
    assert of_falling().metric is LANDED
    of = of_falling(2)
    assert of.together({of.chosen[0]: 0.5}, of.chosen) == 0.25
    assert of.together({of.chosen[0]: 0.5}) == 0.5
    lost = record(metrics={"landed": None})
    assert of.error(of.chosen[0], lost, lost) == 1.0  # all of it


@pytest.mark.parametrize(
    ("metric", "value", "error"),
    [
        (Metric("x", "x", kind="yes_no"), 0.25, 0.75),
        (Metric("x", "x", kind="yes_no", better="lower"), 0.25, 0.25),
        (Metric("x", "x", better="lower"), 0.25, 0.25),
        (Metric("aim", "aim", better=None), 0.5, 1.5),
        (Metric("x", "x", kind="yes_no", better="lower"), math.nan, 1.0),
        (Metric("x", "x", better="lower"), math.nan, FAILED),
    ],
)
def test_an_error_is_from_what_is_right(metric: Metric, value: float, error: float) -> None:
    look = Look(type("Aimed", (Falling,), {"references": {"aim": 2.0}})())
    had = record(metrics={metric.name: value})
    assert replace(of_falling(), metric=metric).error(look, had, had) == pytest.approx(error)


@pytest.mark.parametrize(
    ("name", "cost", "error", "message"),
    [
        ("laws:x", "cpu_cost", None, "no law or phenomenon is named 'x'; choose from free motion"),
        ("laws:impact", "cpu_cost", "hit", "--error: laws have their own"),
        ("x", "cpu_cost", None, "is named 'x'; choose from stacking, throwing, pushing, tosses"),
        ("stacking", "rtf", None, "--cost=rtf: choose from cpu, ram"),
        ("throwing", "cpu_cost", "hits", "did you mean 'hit'"),
        ("throwing", "cpu_cost", "limits", "nothing tells the right limits; name what to choose"),
        ("throwing", "cpu_cost", "converged:hits", "did you mean 'hit'"),
        ("laws:impact", "cpu_cost", "converged", "--error: laws have their own"),
    ],
)
def test_bad_names(name: str, cost: str, error: str | None, message: str) -> None:
    with pytest.raises(TuningError, match=message):
        target(name, cost, error, 4, 9)


def test_what_has_no_right_value_is_not_tuned_for() -> None:
    """Of a height of which more is better the error would be the height, and less be sought."""
    height = Metric("height", "height", unit="m")

    @dataclass(frozen=True)
    class Lifting(Falling):
        metrics = (height, LANDED)

    with pytest.raises(TuningError, match="the right height; .* --error METRIC with landed$"):
        target("t.py::test_it", "cpu_cost", "height", 4, 9, asked=(Lifting(), ()))
    with pytest.raises(TuningError, match=r" --error converged:METRIC with height, landed$"):
        target("t.py::test_it", "cpu_cost", "converged", 4, 9, asked=(Lifting(), ()))


def test_claims_are_of_the_mean() -> None:
    """The worst in units of its limit; what one seed lacks another one may have over."""
    landed, late = LANDED, Metric("late", "late", unit="s", better="lower", least=0)
    of = replace(of_falling(2), metric=None, claims=((landed, at_least(0.5)), (late, at_most(2.0))))
    first = of.chosen[0]

    def error(*values: tuple[float | None, float]) -> float:
        records = [record(metrics={"landed": a, "late": b}) for a, b in values]
        errors = (of.error(first, one, one) for one in records)
        return of.together(dict(zip(of.chosen, errors, strict=False)), of.chosen)

    assert error((0.25, 0.0), (0.75, 2.0)) == 0.0
    assert error((0.25, 2.0), (0.5, 2.0)) == pytest.approx(0.25)
    assert error((0.5, 3.0), (0.5, 5.0)) == pytest.approx(1.0)
    assert (error((0.0, 2.0)), error((0.5, 8.0))) == (0.0, 1.0)  # the other one has 1 to spare
    assert error((None, 2.0), (1.0, 2.0)) > 1e5
    assert (of.laws, of.unit) == (False, "limits")
    of = replace(of, claims=((late, at_most(0.0)),))  # a limit of nought is no unit
    one = record(metrics={"late": 0.3})
    assert of.error(first, one, one) == (0.3,)


def test_measured_data_have_their_halves(monkeypatch: pytest.MonkeyPatch) -> None:
    tosses = Tosses(tuple(Toss(k, np.zeros((2, 13))) for k in range(1, 12)))
    monkeypatch.setattr(module, "read", {"cube_tosses": tosses}.__getitem__)
    found = target("tosses", "cpu_cost", None, None, 72)
    assert (found.metric.name, found.first_judged) == ("position_error", FIRST_JUDGED)
    halves = [
        {look.task.sample(first + look.number - 1) or ("", -1) for look in looks}
        for looks, first in ((found.chosen, FIRST_CHOSEN), (found.judged, FIRST_JUDGED))
    ]
    assert [{number % 2 for _, number in half} for half in halves] == [{0}, {1}]
    assert [len(looks) for looks in (found.chosen, found.judged)] == [5, 6]
    asked = Tossing(tosses), ((Tossing(tosses).metrics[0], at_most(16.0)),)
    found = target("t.py::test_tossing", "cpu_cost", None, 3, 72, asked=asked)
    assert [vars(looks[0].task)["half"] for looks in (found.chosen, found.judged)] == [
        "chosen_on", "held_out",
    ]  # fmt: skip
    assert (found.claims, found.word) == (asked[1], "test_tossing")


@pytest.mark.parametrize(
    ("starts", "halves"), [(0, (1, 0)), (1, (1, 0)), (4, (2, 2)), (5, (3, 2)), (20, (4, 9))]
)
def test_starts_of_a_scene_are_not_judged_again(starts: int, halves: tuple[int, int]) -> None:
    body = cube("c", Pose.at(0.0, 0.0, 0.025), WHITE)
    scene = Scene("s", (body,), starts=(Start(("c",), (body.pose,)),) * starts)
    asked = Settling(scene), ()
    found = target("t.py::test_it", "cpu_cost", "converged:tilt", None, 9, asked=asked)
    numbers = [[look.number for look in looks] for looks in (found.chosen, found.judged)]
    assert (len(numbers[0]), len(numbers[1])) == halves
    assert not {*numbers[0]} & {*numbers[1]}
    assert (found.converged, found.first_judged) == (True, FIRST_CHOSEN)
    claims = ((asked[0].metrics[0], at_most(1.0)),)
    found = target("t.py::test_it", "cpu_cost", None, None, 9, asked=(asked[0], claims))
    assert (found.claims, found.metric, found.first_judged) == (claims, None, FIRST_CHOSEN)
    moved = replace(asked[0], moved=0.001), ()
    found = target("t.py::test_it", "cpu_cost", "converged:tilt", None, 9, asked=moved)
    assert (len(found.chosen), len(found.judged), found.first_judged) == (4, 9, FIRST_JUDGED)


def test_who_follows_a_log_starts_where_it_begins() -> None:
    """The starts of its scene do not count, so there is nothing to judge by."""
    log = log_of(["hinge"])
    asked = Replaying(replace(SCENE, starts=(log.start,) * 8), log), ()
    found = target("t.py::test_it", "cpu_cost", "error_hinges", None, 9, asked=asked)
    assert (len(found.chosen), found.judged) == (1, ())
