"""A record: round trip through its line, what it says of costs."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_simbench.records.record import Failure, Record, RecordError

from .build import record

names = st.text(max_size=8)
numbers = st.floats(-1e100, 1e100)
json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | numbers | names,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(names, inner, max_size=3),
    max_leaves=6,
)
any_record = st.builds(
    Record,
    test=names,
    task=names,
    simulator=names,
    mode=names,
    profile=names,
    repetition=st.integers(min_value=0),
    seed=st.integers(min_value=0),
    status=st.sampled_from(["ok", "failed", "interrupted"]),
    jitter=st.floats(min_value=0, allow_nan=False, allow_infinity=False),
    error=st.none() | st.builds(Failure, st.text(min_size=1), names, names, st.text()),
    metrics=st.dictionaries(names, st.none() | numbers, max_size=4),
    details=st.dictionaries(names, json_values, max_size=3),
    settings=st.dictionaries(names, json_values, max_size=3),
    seconds=st.dictionaries(names, numbers, max_size=3),
    deviations=st.lists(names, max_size=2).map(tuple),
    contended=st.booleans(),
)


@given(any_record)
def test_a_record_survives_the_round_trip(found: Record) -> None:
    line = found.to_json()
    assert "\n" not in line
    assert line.isascii()
    assert Record.from_json(line) == found


@given(any_record)
def test_a_line_cut_anywhere_is_never_taken_for_a_record(found: Record) -> None:
    line = found.to_json()
    for end in {1, len(line) // 3, len(line) // 2, len(line) - 1}:
        with pytest.raises(RecordError):
            Record.from_json(line[:end])


def test_keys_of_a_newer_plugin_are_kept() -> None:
    line = json.dumps({**record().to_dict(), "weather": "rain"})
    found = Record.from_json(line)
    assert found.extra == {"weather": "rain"}
    assert json.loads(found.to_json())["weather"] == "rain"


def test_numpy_values_nan_and_infinity_become_json() -> None:
    found = record(
        metrics={"placed": np.float64(0.5), "hit": np.bool_(True), "x": float("nan")},  # type: ignore[dict-item]
        details={
            "path": Path("a/b"),
            "poses": np.eye(2),
            "seed": np.int64(3),
            "far": float("inf"),
            "names": {"b", "a"},
        },
    )
    data = json.loads(found.to_json())
    assert data["metrics"] == {"placed": 0.5, "hit": True, "x": None}
    assert data["details"] == {"path": "a/b", "poses": [[1, 0], [0, 1]], "seed": 3, "far": None,
                               "names": ["a", "b"]}  # fmt: skip


def test_times_that_were_none_are_not_there_and_what_is_empty_is_not_written() -> None:
    found = record(seconds={"step": float("nan"), "total": 9.5}, timeline={"start": float("inf")})
    read = Record.from_json(found.to_json())
    assert (read.seconds, read.timeline) == ({"total": 9.5}, {})
    told = record(robot={"name": "ur5"}, task_code="1f").to_dict()
    assert told.keys() - record().to_dict().keys() == {"robot", "task_code"}


def test_costs_are_read_from_the_record() -> None:
    found = record()
    assert found.cost("rtf") == 17.5
    assert found.cost("cpu_cost") == pytest.approx(7.9 / 140)
    assert (found.cost("cpu"), found.cost("ram"), found.cost("ram_peak")) == (99, 150, 161)
    assert (found.cost("start"), found.cost("end"), found.cost("total")) == (1.2, 9.0, 9.5)
    bare = record(stepping={"wall": 0.0, "simulated": 1.0}, resources={}, timeline={}, seconds={})
    assert all(bare.cost(name) is None for name in ("rtf", "cpu", "ram", "ram_peak", "start"))


def test_what_is_no_record_is_told_word_by_word() -> None:
    for line, said in (
        ("[1]", "here: a record is a JSON object, not list"),
        ("{", "here: not JSON (Expecting property name enclosed in double quotes: "),
        ("{}", "here: there is no 'test'"),
    ):
        with pytest.raises(RecordError) as caught:
            Record.from_json(line, "here")
        assert str(caught.value).startswith(said)
