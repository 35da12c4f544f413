"""What a scene may hold, wherever it comes from: names, finite numbers, sizes that can exist."""

from __future__ import annotations

import math
from collections.abc import Sequence
from numbers import Real
from typing import Any

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
    check_numbers(pose.position, 3, f"the position of {what}")
    check_numbers(pose.quaternion, 4, f"the quaternion of {what}")
    length = math.hypot(*pose.quaternion)
    if abs(length - 1) > UNIT_TOLERANCE:
        raise SceneError(
            f"the quaternion of {what} has the length {length:.4g}; it must be 1 (w, x, y, z)"
        )
