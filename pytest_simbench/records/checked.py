"""Data from a file that somebody else may have written: checked value by value before it is used.

Numbers are finite and of a size that arithmetic can take, nesting is shallow, and texts can be
written to a file again. Errors name the place inside the data.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from math import isfinite
from typing import Any

DEEPEST = 32
"""Levels of nesting; a record of ours has four."""

LARGEST_INTEGER = 10**300
"""What a float can hold; seeds may have 128 bits."""

LONGEST_NAME = 2000
"""Characters of a name: a test's id with its parameters is rarely longer than 200."""


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


def name(value: Any, where: str) -> str:
    """A text of at most `LONGEST_NAME` characters.

    Raises:
        CheckError: it is something else.
    """
    if not isinstance(value, str):
        raise CheckError(f"{where!r} must be str, not {type(value).__name__}")
    if len(value) > LONGEST_NAME:
        raise CheckError(f"{where!r} has {len(value)} characters, at most {LONGEST_NAME} are read")
    return value


def number(value: Any, where: str, least: float = -math.inf) -> None:
    """A number or None, at least so large.

    Raises:
        CheckError: it is something else.
    """
    if value is not None and not isinstance(value, int | float):
        raise CheckError(f"{where!r} must be a number, not {short(value)}")
    if value is not None and value < least:
        raise CheckError(f"{where!r} must be at least {least:g}, not {value:g}")


def one_of(value: Any, where: str, valid: tuple[Any, ...]) -> None:
    """One of a few values.

    Raises:
        CheckError: it is something else.
    """
    if value not in valid:
        shown = ", ".join(map(str, valid))
        raise CheckError(f"{where!r} is {short(value)}, none of {shown}")


def numbers(value: Mapping[str, Any], where: str) -> None:
    """Numbers by name.

    Raises:
        CheckError: one of them is something else.
    """
    for key, item in value.items():
        number(item, f"{where}.{key}")


def texts(value: Mapping[str, Any], where: str) -> None:
    """Texts by name, of any length.

    Raises:
        CheckError: one of them is something else.
    """
    for key, item in value.items():
        if not isinstance(item, str):
            raise CheckError(f"'{where}.{key}' must be str, not {type(item).__name__}")


def use_of_resources(value: Mapping[str, Any], where: str) -> None:
    """What `client.resources` writes: `cpu_percent`, `rss_mb`, `samples`, and so on by phase.

    Raises:
        CheckError: a part of it is of another type.
    """
    for key, item in value.items():
        place = f"{where}.{key}"
        if key == "phases":
            for phase, part in _mapping(item, place).items():
                use_of_resources(_mapping(part, f"{place}.{phase}"), f"{place}.{phase}")
        elif key in ("cpu_percent", "rss_mb"):
            numbers(_mapping(item, place), place)
        elif key == "samples":
            number(item, place, least=0)


def _mapping(value: Any, where: str) -> Mapping[str, Any]:
    if value is None:
        return {}
    if not isinstance(value, dict):
        raise CheckError(f"{where!r} must be dict, not {type(value).__name__}")
    return value


def short(value: Any) -> str:
    """A value for a message."""
    shown = repr(value)
    return shown if len(shown) <= 60 else f"{shown[:57]}..."
