"""At the README's 20 repetitions each claim of the suites can be supported, and can fail."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from pytest_simbench.data import Impacts, Tosses
from pytest_simbench.data.pushes import ArmRuns
from pytest_simbench.measure.intervals import interval
from pytest_simbench.measure.verdicts import Verdict, at_least, at_most, confidence, judge
from pytest_simbench.records.metrics import CRASHED
from pytest_simbench.tasks import (
    ArmFollowing,
    ArmPushing,
    Impacting,
    Pushing,
    Stacking,
    Task,
    Throwing,
    Tossing,
)

ROOT = Path(__file__).resolve().parents[2]
TASKS: dict[str, tuple[Task, ...]] = {
    "stacking": (Stacking(),),
    "throwing": (Throwing(),),
    "pushing": (Pushing(),),
    "reality": (
        Tossing(Tosses(())),
        Impacting(Impacts(())),
        ArmPushing(ArmRuns((), Path())),
        ArmFollowing(ArmRuns((), Path())),
    ),
}
CLAIMS = [
    (task, relation, name, float(value))
    for task in TASKS
    for relation, name, value in re.findall(
        r'assert_(?:crashed_)?(at_\w+)\(.*?threshold\("(\w+)", ([\d.]+)\)',
        (ROOT / "suites" / f"test_{task}.py").read_text("utf-8"),
    )
]


@pytest.mark.parametrize(("task", "relation", "name", "value"), CLAIMS)
def test_a_claim_is_supported_by_20_of_the_best_and_refuted_by_20_of_the_worst(
    task: str, relation: str, name: str, value: float
) -> None:
    known = [CRASHED, *(metric for one in TASKS[task] for metric in one.metrics)]
    metric = {m.name: m for m in known}[name]
    if relation == "at_least":
        claim, best, worst = at_least(value), 1.0, 0.0
    else:
        claim, best, worst = at_most(value), 0.0, 1.0 if metric.bounded else value + 1
    verdicts = [
        judge(claim, interval([one] * 20, metric, confidence(metric))).verdict
        for one in (best, worst)
    ]
    assert verdicts == [Verdict.SUPPORTED, Verdict.REFUTED]


def test_all_claims_were_found() -> None:
    assert [(task, name) for task, _, name, _ in CLAIMS] == [
        *(("stacking", name) for name in ("crashed", "placed", "at_end", "untouched_moved")),
        *(("throwing", name) for name in ("crashed", "hit", "moved")),
        *(
            ("pushing", name)
            for name in ("crashed", "position_error", "heading_error", "path_error", "tipped")
        ),
        *(("reality", name) for name in ("crashed", "position_error", "position_error")),
        *(("reality", name) for name in ("crashed", "velocity_error", "velocity_error")),
        *(("reality", name) for name in ("turn_error", "hand_error", "hand_error")),
    ]


def test_failures_of_10_percent_take_29_repetitions_and_the_docs_say_so() -> None:
    verdicts = [
        judge(at_most(0.1), interval([0.0] * n, CRASHED, confidence(CRASHED))).verdict
        for n in (20, 28, 29)
    ]
    assert verdicts == [Verdict.INCONCLUSIVE, Verdict.INCONCLUSIVE, Verdict.SUPPORTED]
    page = " ".join((ROOT / "docs" / "gate.md").read_text("utf-8").split())
    assert "no crash in 20 bounds the share at 13.9 % (0.05^(1/20)). 10 % takes 29" in page
