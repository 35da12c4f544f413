"""Plain data from anybody: what can be used, and what is told of the rest."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from pytest_simbench.records import checked
from pytest_simbench.records.checked import DEEPEST, LARGEST_INTEGER, convert, plain
from tests.approval import assert_approved, in_words


def nested(levels: int) -> Any:
    """A number inside so many lists."""
    return 1 if not levels else [nested(levels - 1)]


@dataclass(frozen=True)
class Whole:
    counts: list[checked.Count]
    names: tuple[str, ...] = ()
    size: float = 0.5


def test_what_can_be_used_stays_but_for_what_no_file_takes() -> None:
    sound: Any = [None, True, -2.5, "ä", [], LARGEST_INTEGER, {"ä": nested(DEEPEST - 2)}]
    assert plain(sound) == sound
    assert plain(nested(DEEPEST)) == nested(DEEPEST)
    assert checked.writable("a\ud800ä") == "a?ä"
    found = plain({"\udc80": ["\ud800", {"x": "\ud800b", "y": "é"}], "z": "\ud800"})
    assert found == {"?": ["?", {"x": "?b", "y": "é"}], "z": "?"}


def test_the_rest_is_told_with_its_place() -> None:
    asked: list[tuple[Any, list[Any]]] = [
        (plain, [math.nan, [{"b": [math.inf]}], {"a": {"b": -math.inf}}, nested(DEEPEST + 1)]),
        (plain, [{"a": {"b": [10 * LARGEST_INTEGER]}}, {"a": nested(DEEPEST)}, -(10**301)]),
        (lambda of: convert(of, Whole), [3, {"counts": [{}]}, {"counts": [2]}]),
        (lambda of: convert(of, Whole, "here"), [3, None, [], {}, {"counts": {}}]),
        (lambda of: convert(of, Whole, "in.it"), [{"counts": [0], "size": "1"}, {"counts": [-1]}]),
        (lambda of: convert(of, Whole), [{"counts": [0], "names": ["a"], "size": 2, "more": 1}]),
        (lambda of: checked.schema(of, 3), [{"schema": k} for k in (1, 3, 4, 0, "1")] + [{}, [1]]),
        (checked.short, ["x" * 58, "x" * 59, list(range(50)), {"a": "b"}]),
    ]
    lines = []
    for function, value in ((function, value) for function, of in asked for value in of):
        try:
            lines.append(f"{str(value)[:60]}: {in_words(function(value))}")
        except checked.CheckError as error:
            lines.append(f"{str(value)[:60]}: {error}")
    assert_approved("checked", "\n".join(lines))
