"""What the end of a run says of nodes (what they do: `tests/cluster`)."""

from __future__ import annotations

from dataclasses import replace

from pytest_simbench.plugin.cluster import lost_nodes
from pytest_simbench.records.notes import Notes
from tests.records.build import failed, record


def test_what_was_tried_again_is_counted() -> None:
    again = Notes(lost_nodes=("a: its process ended",))
    cube = {"lost": "left the hand"}  # is no lost node
    assert lost_nodes([record(0), record(1, details=cube)]) == ""
    told = lost_nodes(
        [record(0), record(1, notes=again), replace(failed(2, "NodeLost"), notes=again)]
    )
    assert told.startswith("nodes were lost: 2 of the repetitions")
    assert "1 of them failed for it" in told
