"""Perturbed runs against the unperturbed one, and what became of the outcome in words."""

from __future__ import annotations

from pytest_simbench.repeatability.attack import effect
from pytest_simbench.tasks import LeaningTowers, Stacking
from pytest_simbench.tasks.base import Outcome


def test_effects_in_words() -> None:
    towers, stacking = LeaningTowers(), Stacking()
    up, down = Outcome({}, {"toppled": []}), Outcome({}, {"toppled": ["tower 1", "tower 2"]})
    assert effect(towers, up, down, ["standing"]) == "topples tower 1 and tower 2"
    assert effect(towers, down, up, ["standing"]) == "saves tower 1 and tower 2 from toppling"
    before, after = Outcome({"at_end": 1.0}), Outcome({"at_end": 0.8})
    assert effect(stacking, before, after, ["at_end"]) == "changes at the end from 100 % to 80 %"
    assert effect(stacking, before, before, []) == ""
