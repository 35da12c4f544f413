"""Plain data from anybody: what can be used, and what is told of the rest."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import pytest

from pytest_simbench.records.checked import (
    DEEPEST,
    LARGEST_INTEGER,
    CheckError,
    Count,
    convert,
    plain,
    schema,
    short,
    writable,
)


def nested(levels: int) -> Any:
    """A number inside so many lists."""
    value: Any = 1
    for _ in range(levels):
        value = [value]
    return value


@dataclass(frozen=True)
class Part:
    count: Count
    names: tuple[str, ...] = ()


@dataclass(frozen=True)
class Whole:
    parts: list[Part]
    size: float = 0.5


SOUND: list[Any] = [None, True, 3, -2.5, "text", "ä", [], {}, LARGEST_INTEGER, -LARGEST_INTEGER]


@pytest.mark.parametrize("value", [*SOUND, [*SOUND, SOUND], {"a": SOUND, "ä": {"b": 1e308}}])
def test_what_can_be_used_stays(value: Any) -> None:
    assert plain(value) == value


def test_what_no_file_takes_becomes_a_question_mark() -> None:
    """Of keys and texts at any depth; other letters stay."""
    assert writable("a\ud800ä") == "a?ä"
    found = plain({"\udc80": ["\ud800", {"x": "\ud800b", "y": "é"}], "z": "\ud800"})
    assert found == {"?": ["?", {"x": "?b", "y": "é"}], "z": "?"}


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (math.nan, "'' must be a finite number, not nan"),
        ([{"a": 1}, {"b": [math.inf]}], "'b' must be a finite number, not inf"),
        ({"a": {"b": -math.inf, "c": 1.0}}, "'a.b' must be a finite number, not -inf"),
        ({"a": [LARGEST_INTEGER + 1]}, "'a' is larger than any number of ours"),
        ({"a": {"b": -LARGEST_INTEGER - 1}}, "'a.b' is larger than any number of ours"),
        ({"a": nested(DEEPEST)}, f"'a' is nested more than {DEEPEST} levels deep"),
        (nested(DEEPEST + 1), f"'' is nested more than {DEEPEST} levels deep"),
    ],
)
def test_what_cannot_be_used_is_told_with_its_place(value: Any, said: str) -> None:
    with pytest.raises(CheckError) as error:
        plain(value)
    assert str(error.value) == said


def test_so_deep_it_may_be() -> None:
    assert plain(nested(DEEPEST)) == nested(DEEPEST)


def test_data_become_what_they_are_of() -> None:
    told = {"parts": [{"count": 0, "names": ["a"], "more": 1}], "size": 2}
    assert convert(told, Whole) == Whole([Part(0, ("a",))], 2.0)
    assert convert({"parts": []}, Whole) == Whole([])


@pytest.mark.parametrize(
    "value",
    [
        3, None, [], {}, {"parts": {}}, {"parts": None}, {"parts": [3]}, {"parts": [{}]},
        {"parts": [{"count": -1}]}, {"parts": [{"count": "1"}]}, {"parts": [], "size": "1"},
        {"parts": [{"count": 1, "names": [2]}]}, {"parts": [{"count": 1, "names": None}]},
    ],
)  # fmt: skip
def test_what_they_are_not_is_told_with_its_place(value: Any) -> None:
    for where in ("", "here.there"):
        with pytest.raises(CheckError):
            convert(value, Whole, where)


def test_an_older_schema_is_read_and_a_newer_one_is_not() -> None:
    assert [schema({"schema": k}, 3) for k in (1, 3)] == [1, 3]
    assert schema({}, 3) == 1
    for data in ({"schema": 4}, {"schema": 0}, {"schema": -1}, {"schema": "1"}, {"schema": None}):
        with pytest.raises(CheckError, match=r"schema .* was written by a newer pytest-simbench"):
            schema(data, 3)
    for wrong in (3, None, [1], "x"):
        with pytest.raises(CheckError, match=f"is wanted, not {type(wrong).__name__}$"):
            schema(wrong, 3)


@pytest.mark.parametrize("value", ["x" * 500, list(range(500)), 3, {"a": "b"}, None, "a\nb"])
def test_a_value_is_told_in_short(value: Any) -> None:
    assert len(short(value)) <= 60
