"""Frozen dataclasses as plain data: how a scene crosses the process boundary, and back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, fields
from functools import cache
from typing import Any, ClassVar, Self, get_args, get_origin, get_type_hints


class Wire:
    """A frozen dataclass of numbers, texts, tuples, mappings and others of its kind.

    Attributes:
        optional: fields that are left out when they are as by default: what they tell is younger
            than scenes that were written without them, and whose fingerprints stay.
        unwritten: fields that stay on this side.
    """

    optional: ClassVar[tuple[str, ...]] = ()
    unwritten: ClassVar[tuple[str, ...]] = ()

    def to_wire(self) -> dict[str, Any]:
        """As nested dicts, lists, strings and numbers."""
        told = {}
        for field in fields(self):  # type: ignore[arg-type]
            value = getattr(self, field.name)
            default = field.default if field.default is not MISSING else None
            left_out = field.name in self.optional and value == default
            if not left_out and field.name not in self.unwritten:
                told[field.name] = _plain(value)
        return told

    @classmethod
    def from_wire(cls, data: Mapping[str, Any]) -> Self:
        """What `to_wire` was made of; fields that are missing are as by default."""
        hints = _hints(cls)  # type: ignore[arg-type]
        return cls(**{name: _made(value, hints.get(name)) for name, value in data.items()})


_hints = cache(get_type_hints)


def _plain(value: Any) -> Any:
    if isinstance(value, Wire):
        return value.to_wire()
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    return dict(value) if isinstance(value, Mapping) else value


def _made(value: Any, hint: Any) -> Any:
    """A plain value as its annotated type; lists are tuples there."""
    choices = get_args(hint)
    if get_origin(hint) is not tuple and choices and type(None) in choices:
        hint = next(choice for choice in choices if choice is not type(None))
    if isinstance(value, list | tuple):
        of = (get_args(hint) or (None,))[0]
        return tuple(_made(item, of) for item in value)
    if isinstance(hint, type) and issubclass(hint, Wire) and isinstance(value, Mapping):
        return hint.from_wire(value)
    return value
