"""What a worker answers is of the right type and to the right request; else it is an error."""

from __future__ import annotations

import json

import pytest

from pytest_simbench.client.answers import ANSWERS
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.experiment.repetition import Repetition
from pytest_simbench.records.record import Record
from pytest_simbench.worker.server import Server
from tests.client.test_limits import unruly
from tests.client.unruly import LIES
from tests.tiny import Falling

WRONG = {
    "versions": ("ProtocolError", "launch", "Expected `str`, got `null` - at `$.versions[...]`"),
    "names of versions": ("ProtocolError", "launch", "got `int` - at `key` in `$.versions`"),
    "untested": ("ProtocolError", "launch", "Expected `str`, got `int` - at `$.untested`"),
    "settings": ("ProtocolError", "launch", "got `int` - at `key` in `$.settings`"),
    "deviations": ("ProtocolError", "load", "Expected `str`, got `int` - at `$.excused["),
    "no dict of versions": ("EngineFailed", "launch", "'int' object has no attribute 'get'"),
    "versions that cannot be sent": ("EngineFailed", "launch", "DumpError"),
}


@pytest.mark.parametrize("lie", LIES)
def test_what_an_adapter_says_is_of_the_right_type(case: Case, lie: str) -> None:
    kind, phase, message = WRONG[lie]
    record, _ = Repetition(Experiment(unruly(case, f"Lies {lie}"), Falling()), 1).run()
    assert record.error is not None
    assert (record.error.type, record.error.phase) == (kind, phase)
    assert message in record.error.message
    Record.from_dict(json.loads(record.to_json()))  # whoever reads the folder can


def test_an_engine_that_forks_and_answers_twice(case: Case) -> None:
    record, _ = Repetition(
        Experiment(unruly(case, "Forks", stall_timeout=20.0), Falling()), 1
    ).run()
    assert record.error is not None
    assert record.error.type == "ProtocolError"
    assert "engine forks and its child answers" in record.error.message


def test_every_request_has_its_type() -> None:
    assert {f"do_{name}" for name in ANSWERS} == {n for n in dir(Server) if n.startswith("do_")}
