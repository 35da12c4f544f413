"""Settings of a simulator: named profiles and single values changed by the user."""

from __future__ import annotations

import dataclasses
import math
import reprlib
import types
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from pytest_simbench.ground.errors import SettingsError

S = TypeVar("S", bound="Settings")

SHORTEST_TIMESTEP = 1e-6
"""[s]. A run of more steps would not end in a day."""

LARGEST_TIMESTEP = 1 / 60
"""[s]. At the 3 m/s that the arm reaches, a cube of 5 cm then moves by its own width in a step, and
with longer steps one may pass through another unseen. No engine has a longer default, and no motion
or wait of a task is shorter."""


@dataclass(frozen=True)
class Settings:
    """Base of each adapter's settings: frozen, plain values, every one of them in the record; the
    integration step `timestep` is in [s]."""

    timestep: float = 0.002

    def quantities(self) -> Mapping[str, Any]:
        """What these settings make of quantities that a scene leaves at 0, by pattern of names.

        For options of an engine that act on bodies, links or joints: `body/*/damping`, say.
        """
        return {}

    def to_wire(self) -> dict[str, Any]:
        return dataclasses.asdict(self)


def profile(profiles: Mapping[str, S], name: str, simulator: str) -> S:
    """The named profile of a simulator.

    Raises:
        SettingsError: no such profile; lists those there are.
    """
    if name not in profiles:
        raise SettingsError(
            f"{simulator} has no settings profile {name!r}; choose from {', '.join(profiles)}"
        )
    return profiles[name]


def changed(settings: S, changes: Mapping[str, Any], simulator: str) -> S:
    """The settings with single values changed; texts are converted to each field's type.

    Raises:
        SettingsError: an unknown name, a value its field cannot take, or a time step too coarse for
            the tasks; lists the valid ones.
    """
    hints = get_type_hints(type(settings))
    for name in changes:
        if name not in hints:
            raise SettingsError(
                f"{simulator} has no setting {reprlib.repr(name)}; choose from "
                + ", ".join(f"{key}={getattr(settings, key)}" for key in hints)
            )
    values = {
        name: _converted(value, hints[name], f"{simulator}.{name}")
        for name, value in changes.items()
    }
    result = dataclasses.replace(settings, **values)
    if not SHORTEST_TIMESTEP <= result.timestep <= LARGEST_TIMESTEP:
        raise SettingsError(
            f"{simulator}.timestep={result.timestep:g}: give a number of seconds from "
            f"{SHORTEST_TIMESTEP:g} to {LARGEST_TIMESTEP:.4g}, in which a thrown cube moves by its "
            "own width"
        )
    return result


def _converted(value: Any, hint: Any, where: str) -> Any:
    """`value`, perhaps a text from the command line, as the annotated type `hint`."""
    origin = get_origin(hint)
    text = value if isinstance(value, str) and len(value) < 40 else reprlib.repr(value)
    if origin is Literal:
        choices = get_args(hint)
        for choice in choices:
            if str(value) == str(choice):
                return choice
        raise SettingsError(f"{where}={text}: choose from {', '.join(map(str, choices))}")
    if origin in (Union, types.UnionType):
        options = [option for option in get_args(hint) if option is not type(None)]
        if value is None or value == "none":
            return None
        return _converted(value, options[0], where)
    if origin is tuple:
        parts = value.split("/") if isinstance(value, str) else value
        kinds = get_args(hint)
        if not isinstance(parts, list | tuple) or len(parts) != len(kinds):
            raise SettingsError(f"{where}={text}: give {len(kinds)} numbers, separated by '/'")
        return tuple(_converted(p, k, where) for p, k in zip(parts, kinds, strict=True))
    found = _of_type(value, hint)
    if found is None:
        raise SettingsError(f"{where}={text}: {_ADVICE.get(hint, f'give a {hint.__name__}')}")
    return found


_TRUTH = {"1": True, "true": True, "on": True, "0": False, "false": False, "off": False}

_ADVICE = {bool: "give true or false", int: "give a whole number", float: "give a finite number"}


def _of_type(value: Any, hint: type) -> Any:
    """`value`, a text or of the type itself, as `hint`; None where nothing would be the same."""
    if hint is bool:
        return _TRUTH.get(value.lower()) if isinstance(value, str) else _same(value, bool)
    if hint in (int, float):
        if isinstance(value, bool) or not hasattr(value, "__float__") | isinstance(value, str):
            return None
        try:
            number = hint(value)
            same = math.isfinite(number) and (isinstance(value, str) or number == value)
        except (TypeError, ValueError, OverflowError):
            return None
        return number if same else None
    return _same(value, hint)


def _same(value: Any, hint: type) -> Any:
    return value if isinstance(value, hint) else None
