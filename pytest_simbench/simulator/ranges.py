"""How a setting may be searched, declared beside it: `Annotated[float, Log(1e-4, 1e-2)]`.

Its meaning is what the docstring of its class says of it under `Attributes:`."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

from pytest_simbench.simulator.settings import Settings

When = tuple[Any, ...]
"""Name of another setting, and the values of it with which this one acts."""


@dataclass(frozen=True)
class Linear:
    """Numbers from `low` to `high`, both included."""

    low: float
    high: float
    when: When = field(default=(), kw_only=True)

    def __str__(self) -> str:
        return f"{self.low:g} to {self.high:g}"


class Log(Linear):
    """The same on a logarithmic scale."""

    def __str__(self) -> str:
        return f"{super().__str__()} log"


@dataclass(frozen=True)
class Each:
    """Each value that the setting may have; of a flag, both."""

    when: When = ()


EACH = Each()


@dataclass(frozen=True)
class Searched:
    """One number or choice that a search may vary.

    Attributes:
        setting: whose it is.
        part: its place in a setting of several numbers; else None.
        over: numbers from one to another, or values to choose from.
        whole: whether only whole numbers will do.
        when: see `When`.
    """

    setting: str
    part: int | None
    over: Linear | tuple[Any, ...]
    whole: bool = False
    when: When = ()

    @property
    def name(self) -> str:
        """The setting's; of one of several numbers `solref/1`, counted from 1."""
        return self.setting if self.part is None else f"{self.setting}/{self.part + 1}"

    def __str__(self) -> str:
        over = " or ".join(map(str, self.over)) if isinstance(self.over, tuple) else str(self.over)
        which = f" ({self.when[0]} {' or '.join(map(str, self.when[1:]))})" if self.when else ""
        return over + which


def searched(kind: type[Settings]) -> tuple[Searched, ...]:
    """What of these settings may be searched, in their order."""
    hints = get_type_hints(kind, include_extras=True)
    return tuple(
        one for item in fields(kind) for one in _searched(item.name, None, hints[item.name])
    )


def _searched(name: str, part: int | None, hint: Any) -> Iterator[Searched]:
    if get_origin(hint) is tuple:
        for k, inner in enumerate(get_args(hint)):
            yield from _searched(name, k, inner)
    if get_origin(hint) is not Annotated:
        return
    inner, *notes = get_args(hint)
    for note in notes:
        if isinstance(note, Linear):
            yield Searched(name, part, note, inner is int, note.when)
        elif isinstance(note, Each):
            choices = get_args(inner) if get_origin(inner) is Literal else (False, True)
            yield Searched(name, part, choices, False, note.when)


def changes(values: Mapping[str, Any], base: Settings) -> dict[str, Any]:
    """Values by the names of `Searched` as changes of settings."""
    found: dict[str, Any] = {}
    for name, value in values.items():
        setting, _, part = name.partition("/")
        if part:
            whole = list(found.get(setting, getattr(base, setting)))
            whole[int(part) - 1] = value
            found[setting] = tuple(whole)
        else:
            found[setting] = value
    return found


def meanings(kind: type[Settings]) -> dict[str, str]:
    """What each setting is, by the docstrings."""
    found: dict[str, str] = {}
    for one in reversed(kind.__mro__):
        _, _, listed = inspect.cleandoc(one.__doc__ or "").partition("Attributes:\n")
        for names, text in re.findall(r"^    (\w[\w, ]*): (.*(?:\n {8}.*)*)", listed, re.M):
            found |= dict.fromkeys(names.split(", "), " ".join(text.split()))
    return {item.name: found.get(item.name, "") for item in fields(kind)}


def in_words(value: Any) -> str:
    """A setting's value as a command line takes it."""
    if isinstance(value, tuple):
        return "/".join(map(in_words, value))
    return f"{value:.5g}" if isinstance(value, float) else str(value)
