"""Repetitions that fail: on a faulty adapter, with nobody who watches their progress."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.records.record import Record
from pytest_simbench.tasks import Task
from pytest_simbench.worker.wire import LONGEST
from tests.conftest import workers
from tests.tiny import Falling

STALL = 2.0
"""Limit of silence of a faulty worker [s]."""


class Silent:
    """Progress that nobody watches."""

    def __getattr__(self, name: str) -> object:
        return lambda *arguments: None


def faulty(case: Case, name: str, **changes: Any) -> Case:
    """The case with an adapter of `tests.client.faulty`."""
    options = {"stall_timeout": STALL, "timeout": 60.0, **changes}
    return replace(case, adapter=f"tests.client.faulty:{name}", **options)


def run(case: Case, task: Task | None = None, number: int = 1) -> Record:
    """The record of one repetition, of which no worker is left."""
    before = workers()
    record, _ = Repetition(Experiment(case, task or Falling()), number).run()
    assert not workers() - before, "a worker was left behind"
    return record


def failure(case: Case, task: Task | None = None) -> tuple[str, str, str]:
    """Type, phase and message of the error; the record is one that anybody can read."""
    record = run(case, task)
    assert (record.status, record.metrics) == ("failed", {})
    text = record.to_json()
    assert Record.from_dict(json.loads(text)) == Record.from_json(text)
    text.encode("utf-8")
    assert len(text) < 30_000
    assert 0 < len(record.error.message) < LONGEST + 200
    return record.error.type, record.error.phase, record.error.message
