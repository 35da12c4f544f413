"""What a scene may hold, wherever it comes from: names, finite numbers, sizes that can exist; and
how its frozen dataclasses cross the process boundary as plain data, and come back."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields
from functools import cache
from numbers import Real
from typing import Any, ClassVar, Self, get_args, get_origin, get_type_hints

LARGEST = 1e6
"""No length [m], mass [kg], friction or speed of a scene is larger."""

STIFFEST = 1e12
"""No stiffness, damping or effort of a drive is larger [N m/rad, N m s/rad, N m, or with N/m]."""

LONGEST_NAME = 100

UNIT_TOLERANCE = 1e-3
"""How far the length of a quaternion or an axis may be from 1: four digits, as people write it."""

FORBIDDEN = "/\\\"'<>&"
"""Characters with a meaning in file names, in the paths of USD and in XML."""

RESERVED = ("ground", "world")
"""Names of what is in every scene of every engine."""


class SceneError(ValueError):
    """A scene that cannot exist: bodies of one name or inside each other, a mass below zero."""


def check_name(name: Any, what: str) -> None:
    """A name that every engine, file system and report can hold."""
    if not isinstance(name, str) or not name.strip():
        raise SceneError(f"{what} has the name {name!r}; give it a text")
    if (
        len(name) > LONGEST_NAME
        or not name.isprintable()
        or name.strip(" .") != name
        or set(name) & set(FORBIDDEN)
    ):
        raise SceneError(
            f"{what} has the name {name[:LONGEST_NAME]!r}; a name has up to {LONGEST_NAME} "
            f"printable characters, none of {' '.join(FORBIDDEN)}, and no blank or dot at its ends"
        )


def check_number(
    value: Any, what: str, least: float = -LARGEST, most: float = LARGEST, *, above: bool = False
) -> None:
    """A finite number from `least` (`above`: more than it) to `most`."""
    __tracebackhide__ = True
    number: Any = value if isinstance(value, Real) and not isinstance(value, bool) else math.nan
    if not ((least < number if above else least <= number) and number <= most):
        bound = "a number above" if above else "a number from"
        raise SceneError(f"{what} is {value!r:.80}; it must be {bound} {least:g} to {most:g}")


def check_count(value: Any, what: str, most: float = LARGEST) -> None:
    """A whole number from 1 to `most`."""
    check_number(value, what, 1, most)
    if value != int(value):
        raise SceneError(f"{what} is {value!r:.80}; it must be a whole number")


def check_choice(value: Any, what: str, choices: Sequence[str]) -> None:
    """One of some words."""
    if value not in choices:
        raise SceneError(f"{what} is {value!r:.80}; choose from {', '.join(choices)}")


def check_numbers(
    values: Any, count: int, what: str, least: float = -LARGEST, *, above: bool = False
) -> None:
    """So many finite numbers."""
    if isinstance(values, str) or not isinstance(values, Sequence) or len(values) != count:
        raise SceneError(f"{what} is {values!r:.80}; it must be {count} numbers")
    for value in values:
        check_number(value, what, least, above=above)


def check_pose(pose: Any, what: str) -> None:
    """A finite position, and a quaternion of unit length."""
    if not hasattr(pose, "quaternion"):
        raise SceneError(f"the pose of {what} is {pose!r:.80}; give a Pose")
    check_numbers(pose.position, 3, f"the position of {what}")
    check_numbers(pose.quaternion, 4, f"the quaternion of {what}")
    length = math.hypot(*pose.quaternion)
    if abs(length - 1) > UNIT_TOLERANCE:
        raise SceneError(
            f"the quaternion of {what} has the length {length:.4g}; it must be 1 (w, x, y, z)"
        )


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
