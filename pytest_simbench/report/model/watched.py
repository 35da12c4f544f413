"""What a watch tells: each release that it judged, the newest first."""

from __future__ import annotations

from collections.abc import Sequence

from pytest_simbench.measure.watching import Step
from pytest_simbench.report.model.document import Column, Section, Table

CHANGED, UNCHANGED = "changed", "no certain change"


def section(steps: Sequence[Step], sentences: Sequence[str]) -> Section:
    """What the last watch did, and a line for each release."""
    rows = list(reversed(steps))
    columns = [
        Column("engine", [step.engine for step in rows], left=True),
        Column("old", [step.old for step in rows], left=True),
        Column("new", [step.new for step in rows], left=True),
        Column("verdict", [CHANGED if s.changed else UNCHANGED for s in rows], left=True),
        Column("what changed", ["; ".join(step.changed) for step in rows], left=True, wrap=True),
        Column("besides", ["; ".join(step.told) for step in rows], left=True, wrap=True),
        Column("judged on", [step.day for step in rows], left=True),
    ]
    return Section("Release watch", sentences, [Table("releases", columns)] if rows else [])
