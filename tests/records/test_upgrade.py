"""Records of pytest-simbench 0.1 (schema 1) are read as those of today."""

from __future__ import annotations

from typing import Any

import pytest

from pytest_simbench.records.notes import Notes
from pytest_simbench.records.readings import Reading
from pytest_simbench.records.record import Record
from pytest_simbench.records.tuned_on import Seen
from pytest_simbench.records.upgrade import taken_apart

from .build import record

OLD = ("function", "variant", "version", "notes")
"""Fields that a record of schema 1 has not."""


def old(details: dict[str, Any], **changes: Any) -> Record:
    """A record of schema 1 with these details, read."""
    data = {k: v for k, v in record(1).to_dict().items() if k not in OLD}
    return Record.from_dict({**data, "schema": 1, "details": details, **changes})


def test_what_the_tool_noted_among_the_details_is_found_among_the_notes() -> None:
    found = old(
        {
            "log": "logs/a.log",
            "own_timestep": 0.002,
            "data": ["cube_tosses", 7],
            "chosen_on": [{"task": "stacking", "first": 1, "last": 3},
                          {"data": "cube_tosses", "first": 0, "last": 564, "step": 6}],
            "law": {"quantity": "height", "value": 1.0, "exact": 1.5, "tolerance": 0.1},
            "moved": ["cube_3"],
        }
    )  # fmt: skip
    assert found.notes == Notes(
        log="logs/a.log",
        own_timestep=0.002,
        chosen_on=(Seen.seeds("stacking", 1, 3), Seen.motions("cube_tosses", 0, 564, 6)),
        sample=("cube_tosses", 7),
        reading=Reading(1.0, 1.5, 0.1),
    )
    assert found.details == {"moved": ["cube_3"]}
    assert Record.from_json(found.to_json()) == found


@pytest.mark.parametrize("name", ["log", "untested", "filmed", "video", "trace", "chosen_on",
                                  "closing", "own_timestep", "data", "law"])  # fmt: skip
@pytest.mark.parametrize("value", [[3, {}], {"x": 1}])
def test_a_tasks_own_detail_of_such_a_name_stays_the_tasks(name: str, value: Any) -> None:
    found = old({name: value})
    assert found.details == {name: value}
    assert found.notes == Notes()
    mine = record(1, details={name: value})
    assert Record.from_json(mine.to_json()) == mine


@pytest.mark.parametrize(
    ("test", "function", "variant"),
    [
        ("a.py::t[sim==3-headless]", "a.py::t", ""),
        ("a.py::t[sim==3-headless-ur5-real-dt=2ms-x-1]", "a.py::t", "x-1"),
        ("a.py::t[x-sim==3-headless-y]", "a.py::t", "x-y"),
        ("a.py::C::t[a::b]", "a.py::C::t", "a::b"),
        ("t", "t", ""),
    ],
)
def test_the_id_is_taken_apart(test: str, function: str, variant: str) -> None:
    assert taken_apart(test, "sim==3", "headless", "real", "ur5") == (function, variant)
    robot = {"name": "ur5", "digest": "1"}
    found = old({}, test=test, simulator="sim==3", profile="real", robot=robot)
    assert (found.function, found.variant, found.version) == (function, variant, "3")
    assert found.name == test.removeprefix("a.py::").removeprefix("C::")
