"""What the end of a run says of nodes (what they do: `tests/cluster`)."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pytest_simbench.plugin.cluster import lost_nodes
from pytest_simbench.records.notes import Notes
from tests.records.build import failed, record

TASK = """
from dataclasses import replace
from tests.tiny import Falling

class Losing(Falling):
    def perform(self, world, seed, count):
        outcome = super().perform(world, seed, count)
        return replace(outcome, details={**outcome.details, "lost": "left the hand"})

def test_losing(repeat):
    repeat(Losing())
"""


def test_a_lost_cube_is_no_lost_node(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_it=TASK)
    result = pytester.runpytest_subprocess("--sim=mujoco", "--reps=1", "--sim-output=out")
    assert result.ret == 0
    assert '"lost": "left the hand"' in (pytester.path / "out" / "records.jsonl").read_text()
    result.stdout.no_fnmatch_line("*nodes were lost*")


def test_what_was_tried_again_is_counted() -> None:
    again = Notes(lost_nodes=("a: its process ended",))
    assert lost_nodes([record(0), record(1)]) == ""
    told = lost_nodes(
        [record(0), record(1, notes=again), replace(failed(2, "NodeLost"), notes=again)]
    )
    assert told.startswith("nodes were lost: 2 of the repetitions")
    assert "1 of them failed for it" in told
