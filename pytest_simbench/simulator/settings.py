"""Settings of a simulator: named profiles and single values changed by the user.

How a setting may be searched is declared beside it: `Annotated[float, Log(1e-4, 1e-2)]`. Its
meaning is what the docstring of its class says of it under `Attributes:`.
"""

from __future__ import annotations

import dataclasses
import inspect
import math
import re
import reprlib
import types
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from pytest_simbench.ground.errors import SettingsError

S = TypeVar("S", bound="Settings")

SHORTEST_TIMESTEP = 1e-6
"""[s]. A run of more steps would not end in a day."""

TOO_MANY = 2**31
"""Engines hold whole numbers in 32 bits."""

LARGEST_TIMESTEP = 0.01667
"""[s], a sixtieth as it is told. At the 3 m/s that the arm reaches, a cube of 5 cm then moves by
its own width in a step, and with longer steps one may pass through another unseen. No engine has a
longer default, and no motion or wait of a task is shorter."""


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


UNDECORATED = (
    "what the class sets counts in a dataclass alone: write @dataclass(frozen=True) above class {}"
)


def flaw(profiles: Mapping[str, Any]) -> str:
    """What is wrong with the profiles of an adapter, in one sentence; empty where nothing is."""
    for name, settings in profiles.items():
        kind = type(settings)
        if not isinstance(settings, Settings):
            return f"profile {name!r} is no instance of a class of Settings: {settings!r:.60}"
        if "__dataclass_fields__" not in vars(kind):
            return UNDECORATED.format(kind.__name__)
    return ""


def changed(settings: S, changes: Mapping[str, Any], simulator: str) -> S:
    """The settings with single values changed; texts are converted to each field's type.

    Raises:
        SettingsError: an unknown name, a value its field cannot take, one that makes no sense of
            what is searched (`Linear.problem`), or a time step too coarse for the tasks; lists the
            valid ones.
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
    for one in searched(type(settings)):
        value, default = values.get(one.setting), getattr(type(settings), one.setting, None)
        if not isinstance(one.over, Linear) or value in (None, default):
            continue
        value = value if one.part is None else value[one.part]
        wanted = one.over.problem(value)
        if one.whole and value >= TOO_MANY:
            wanted = f"a number below {TOO_MANY}"
        if wanted:
            raise SettingsError(
                f"{simulator}.{one.name}={value:g}: give {wanted}, "
                f"{one.over.low:g} to {one.over.high:g} for instance"
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
        if str(value).lower() == "none":  # as `in_words` and `--sim-settings` have it
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


When = tuple[Any, ...]
"""Name of another setting, and the values of it with which this one acts."""


@dataclass(frozen=True)
class Linear:
    """Numbers from `low` to `high`, both included: those that a search tries. More can be set."""

    low: float
    high: float
    when: When = field(default=(), kw_only=True)

    def __str__(self) -> str:
        return f"{self.low:g} to {self.high:g}"

    def problem(self, value: float) -> str:
        """What to give instead of a number that cannot be meant; empty where it can."""
        return "a number from 0 on" if value < 0 <= self.low else ""


class Share(Linear):
    """The same of what is between 0 and 1."""

    def problem(self, value: float) -> str:
        return "" if 0 <= value <= 1 else "a number from 0 to 1"


@dataclass(frozen=True)
class Log(Linear):
    """The same on a logarithmic scale, which has no `zero`; some settings have it."""

    zero: bool = field(default=False, kw_only=True)

    def problem(self, value: float) -> str:
        return "" if value > 0 or (self.zero and not value) else "a number above 0"

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
    whole: bool
    when: When

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
