"""What is tuned for, and the two halves."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pytest_simbench.laws import LAWS, Law
from pytest_simbench.laws.held_out import OTHER, held_out
from pytest_simbench.tuning.target import TIMES, Look, TuningError, target

from .made_up import LANDED
from .made_up import target as of_falling


def test_laws_are_judged_at_other_parameters() -> None:
    found = target("laws:sticking,grip_holds", "cpu_cost", None, 4, 9)
    names = {law.name for law in LAWS if law.phenomenon == "sticking"} | {"grip_holds"}
    assert {look.task.name for look in found.chosen} == names
    assert len(found.chosen) == len(TIMES) * len(names)
    assert not {*found.chosen} & {*found.judged}
    assert {look.task.name for look in found.judged} <= {look.task.name for look in found.chosen}


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_a_law_at_other_parameters_is_another(law: Law) -> None:
    other = held_out(law)
    assert (other is None) == (law.name not in OTHER)
    if other is not None:
        assert other != law
        other.build()


def test_every_name_is_a_laws() -> None:
    assert OTHER.keys() <= {law.name for law in LAWS}


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
    assert of_falling(2).together({Look(of_falling().chosen[0].task, 1): 0.5}) == 0.25


@pytest.mark.parametrize(
    ("name", "cost", "error", "message"),
    [
        ("laws:x", "cpu_cost", None, "no law or phenomenon is named 'x'; choose from free motion"),
        ("laws:impact", "cpu_cost", "hit", "--error: laws have their own"),
        ("x", "cpu_cost", None, "is named 'x'; choose from stacking, throwing, pushing, or laws:"),
        ("stacking", "rtf", None, "--cost=rtf: choose from cpu, ram"),
        ("throwing", "cpu_cost", "hits", "did you mean 'hit'"),
        ("throwing", "cpu_cost", "limits", "no metric is named 'limits'"),
    ],
)
def test_bad_names(name: str, cost: str, error: str | None, message: str) -> None:
    with pytest.raises(TuningError, match=message):
        target(name, cost, error, 4, 9)
