"""A real engine in a real worker whose cubes do what no cube can: the repetition has diverged."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.tasks import LeaningTowers


@pytest.mark.parametrize(
    ("ghost", "message"),
    [
        ("Sinking", "deep in the ground"),
        ("Flying", "'cube_01' left the room"),
        ("Merging", "'cube_01' and 'cube_02' overlap by"),
    ],
)
def test_a_world_that_cannot_be_is_not_scored(case: Case, ghost: str, message: str) -> None:
    case = replace(case, adapter=f"tests.client.ghosts:{ghost}")
    record, _ = Repetition(Experiment(case, LeaningTowers(margins=(0.015,))), 1).run()
    assert record.status == "failed"
    assert record.error is not None
    assert (record.error.type, record.error.phase) == ("Diverged", "settle")
    assert message in record.error.message
    assert not record.metrics
