"""Data from a file that somebody else may have written: checked value by value before it is used.

Numbers are finite and of a size that arithmetic can take, nesting is shallow, and texts can be
written to a file again. Errors name the place inside the data.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from math import isfinite
from typing import Annotated, Any, TypeVar

import msgspec

DEEPEST = 32
"""Levels of nesting; a record of ours has four."""

LARGEST_INTEGER = 10**300
"""What a float can hold; seeds may have 128 bits."""

LARGEST = 1e100
"""Of what is measured: third powers of it are finite (`measure.intervals`)."""

LONGEST_NAME = 2000
"""Characters of a name: a test's id with its parameters is rarely longer than 200."""


Name = Annotated[str, msgspec.Meta(max_length=LONGEST_NAME)]
Count = Annotated[int, msgspec.Meta(ge=0)]
Positive = Annotated[int, msgspec.Meta(ge=1)]
Size = Annotated[float, msgspec.Meta(ge=0)]
Number = Annotated[float, msgspec.Meta(ge=-LARGEST, le=LARGEST)]

T = TypeVar("T")


class CheckError(ValueError):
    """A value that cannot be used; the message says where in the data it stands."""


def plain(value: Any) -> Any:
    """`value` as it can be used: lists, dicts with texts as keys, texts, finite numbers, None.

    Lone surrogates, which no file takes as UTF-8, become "?".

    Raises:
        CheckError: nested too deeply, or a number that is infinite, none, or too large.
    """
    return _plain(value, (), 0)


def _plain(value: Any, where: tuple[Any, ...], depth: int) -> Any:
    """`where` is the key, and before it those of what holds it."""
    kind = type(value)
    if kind is str:
        return value if value.isascii() else writable(value)
    if kind is float:
        if isfinite(value):
            return value
        raise CheckError(f"{_place(where)!r} must be a finite number, not {value}")
    if depth > DEEPEST:
        raise CheckError(f"{_place(where)[:60]!r} is nested more than {DEEPEST} levels deep")
    if isinstance(value, dict):
        found = {}
        for key, item in value.items():
            key = sys.intern(key if key.isascii() else writable(key))
            kind = type(item)  # most are such: a call for each would take as long as the rest
            fine = isfinite(item) if kind is float else kind is str and item.isascii()
            found[key] = item if fine else _plain(item, (where, key), depth + 1)
        return found
    if isinstance(value, list):
        return [_plain(item, where, depth + 1) for item in value]
    if isinstance(value, int) and abs(value) > LARGEST_INTEGER:
        raise CheckError(f"{_place(where)!r} is larger than any number of ours")
    return value


def _place(where: tuple[Any, ...]) -> str:
    keys = []
    while where:
        where, key = where
        keys.append(key)
    return ".".join(reversed(keys))


def writable(text: str) -> str:
    """A text that can be encoded as UTF-8."""
    return text if text.isascii() else text.encode("utf-8", "replace").decode("utf-8")


def convert(value: Any, kind: type[T], where: str = "") -> T:
    """Plain data as the dataclass (or typed dict) that they are of; more keys count for nothing.
    `where` is the place of the data, for messages.

    Raises:
        CheckError: a key is missing, or a value is of another type or outside its bounds.
    """
    try:
        return msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        text, _, path = str(error).replace("`", "'").partition(" - at ")
        path = ".".join(filter(None, [where, path.strip("'").removeprefix("$").lstrip(".")]))
        text = text.replace("Object missing required field", "there is no")
        text = text.replace("object", "dict").replace("array", "list").replace("null", "None")
        raise CheckError(f"{path!r}: {_small(text)}" if path else _small(text)) from None


def _small(text: str) -> str:
    return text[:1].lower() + text[1:]


def schema(data: Any, newest: int) -> int:
    """The schema that data are of; 1 where they do not say.

    Raises:
        CheckError: a newer one than this plugin reads, or data that are no object.
    """
    if not isinstance(data, Mapping):
        raise CheckError(f"a JSON object is wanted, not {type(data).__name__}")
    found = data.get("schema", 1)
    if not isinstance(found, int) or not 0 < found <= newest:
        raise CheckError(
            f"schema {short(found)} was written by a newer pytest-simbench (this one reads up to "
            f"{newest}); update it"
        )
    return found


def short(value: Any) -> str:
    """A value for a message."""
    shown = repr(value)
    return shown if len(shown) <= 60 else f"{shown[:57]}..."
