"""Settings of a simulator: named profiles and single values changed by the user."""

from __future__ import annotations

import dataclasses
import types
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from pytest_simbench.simulator.errors import SettingsError

S = TypeVar("S", bound="Settings")


@dataclass(frozen=True)
class Settings:
    """Base of each adapter's settings: frozen, plain values, every one of them in the record.

    Attributes:
        timestep: integration step [s].
    """

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
        SettingsError: an unknown name, or a value its field cannot take; lists the valid ones.
    """
    hints = get_type_hints(type(settings))
    for name in changes:
        if name not in hints:
            raise SettingsError(
                f"{simulator} has no setting {name!r}; choose from "
                + ", ".join(f"{key}={getattr(settings, key)}" for key in hints)
            )
    values = {
        name: _converted(value, hints[name], f"{simulator}.{name}")
        for name, value in changes.items()
    }
    result = dataclasses.replace(settings, **values)
    if not result.timestep > 0:
        raise SettingsError(f"{simulator}.timestep must be positive, not {result.timestep}")
    return result


def _converted(value: Any, hint: Any, where: str) -> Any:
    """`value`, perhaps a text from the command line, as the annotated type `hint`."""
    origin = get_origin(hint)
    if origin is Literal:
        choices = get_args(hint)
        for choice in choices:
            if value == choice or str(value) == str(choice):
                return choice
        raise SettingsError(f"{where}={value}: choose from {', '.join(map(str, choices))}")
    if origin in (Union, types.UnionType):
        options = [option for option in get_args(hint) if option is not type(None)]
        if value is None or value == "none":
            return None
        return _converted(value, options[0], where)
    if origin is tuple:
        parts = value.split("/") if isinstance(value, str) else list(value)
        kinds = get_args(hint)
        if len(parts) != len(kinds):
            raise SettingsError(f"{where}={value}: give {len(kinds)} numbers, separated by '/'")
        return tuple(_converted(p, k, where) for p, k in zip(parts, kinds, strict=True))
    if hint is bool and isinstance(value, str):
        texts = {"1": True, "true": True, "on": True, "0": False, "false": False, "off": False}
        if value.lower() not in texts:
            raise SettingsError(f"{where}={value}: give true or false")
        return texts[value.lower()]
    try:
        return hint(value)
    except (TypeError, ValueError):
        raise SettingsError(f"{where}={value!r} is not a valid {hint.__name__}") from None
