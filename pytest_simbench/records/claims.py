"""What tests claimed, and what came of it: the first thing that a reader of a run looks for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pytest_simbench.records.checked import Count, Name
from pytest_simbench.records.description import FolderLine

Verdict = Literal["PASS", "FAIL", "UNDECIDED", "XFAIL", ""]
"""What the repetitions say; XFAIL: it fails, and its test was expected to or caught it; empty:
nothing any more, since the test is judged anew."""

Relation = Literal["at least", "at most"]


@dataclass(frozen=True)
class Claim(FolderLine):
    """One claim of one test, and its verdict. Of several of one `identity` the last one holds.

    Attributes:
        test, function, variant, simulator, mode, profile, task: as in `record.Record`; `task` is
            empty where the test as a whole failed.
        metric, relation, threshold: what was claimed of which metric; empty where the test as a
            whole failed.
        parameters: of the task, as `configuration.task_parameters` tells them.
        number: of claims of one test that are alike in task, metric and relation, from 0.
        verdict: what the repetitions say of it.
        mean, low, high: what was measured, and the bounds that decided; None where there are none.
        n, crashed: repetitions that were judged, and those of them that crashed.
        without: finished repetitions that have no value.
        advice: what to do about one that is not decided; why a test as a whole failed.
    """

    test: Name
    function: Name
    simulator: Name
    mode: Name
    profile: Name
    verdict: Verdict
    variant: Name = ""
    task: Name = ""
    metric: Name = ""
    relation: Relation | None = None
    threshold: float | None = None
    mean: float | None = None
    low: float | None = None
    high: float | None = None
    n: Count = 0
    crashed: Count = 0
    without: Count = 0
    advice: str = ""
    parameters: str = ""
    number: Count = 0

    @property
    def identity(self) -> tuple[object, ...]:
        """What tells it from other claims of a run."""
        return self.test, self.task, self.metric, self.relation, self.number
