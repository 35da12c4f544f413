"""The gate on times: a busy machine does not fire it, an engine that is 30 % slower does."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.executor import LocalExecutor
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repeater import Repeater
from pytest_simbench.measure.gate import GateReport, run_gate
from pytest_simbench.measure.limits import parse_limits
from pytest_simbench.records.record import Record
from pytest_simbench.report.terminal.progress import Progress
from tests.tiny import Falling
from tests.worker.test_control import busy_machine

LIMIT = "rtf:12%"
TASK = Falling(duration=15.0)
"""About a quarter of a second of stepping."""


def repetitions(case: Case) -> list[Record]:
    kept: list[Record] = []
    case = replace(case, timeout=600.0, stall_timeout=120.0)  # a machine that is very busy
    progress = Progress(lambda text: None, is_tty=False)
    Repeater(Experiment(case, TASK), LocalExecutor(1), progress, kept.append).run(range(1, 7))
    assert all(record.ok for record in kept)
    return kept


def gate(before: list[Record], after: list[Record]) -> GateReport:
    metrics = {TASK.name: TASK.metrics}
    return run_gate(before, after, parse_limits(LIMIT, TASK.metrics), metrics)


@pytest.fixture
def baseline(case: Case) -> list[Record]:
    return repetitions(case)


def test_a_busy_machine_passes_and_a_slower_engine_does_not(
    case: Case, baseline: list[Record]
) -> None:
    with busy_machine():
        busy = repetitions(case)
    report = gate(baseline, busy)
    assert report.changes[0].normalised
    assert report.failures == ()
    waited = [record.stepping["waited"] / record.stepping["wall"] for record in busy]
    assert sum(waited) / len(waited) > 0.12  # as it is, the time would have fired the gate

    slower = repetitions(replace(case, adapter="tests.slower:Slower"))
    assert [r.metrics for r in slower] == [r.metrics for r in baseline]
    (failure,) = gate(baseline, slower).failures
    assert "rtf fell from" in failure
    assert "machine speed taken out" in failure
