"""Which simulators are known, and which of them are here."""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import Distribution, EntryPoint, distributions
from typing import Any

from pytest_simbench.ground.errors import SimulatorError
from pytest_simbench.ground.versions import VersionedName, base_name
from pytest_simbench.records.tuned_on import Seen
from pytest_simbench.simulator.base import Simulator
from pytest_simbench.simulator.info import SimulatorInfo
from pytest_simbench.simulator.settings import Settings, changed, flaw, profile

GROUP = "pytest_simbench.simulators"
"""Entry-point group in which adapters register, `name = "package.module:Class"`."""

RESERVED = ("all", "none")
"""Names that mean something else in `--sim` and in test ids."""


class UnknownSimulatorError(SimulatorError):
    """A simulator's name that nobody registered."""


@dataclass(frozen=True)
class Registry:
    """What the installed distributions register. One that is broken spoils no other.

    Attributes:
        entries: by simulator name, sorted; each name that can be used.
        broken: names that nothing can be made of, with the reason.
        unreadable: sentences, one for each distribution whose metadata cannot be read.
    """

    entries: Mapping[str, EntryPoint]
    broken: Mapping[str, str]
    unreadable: tuple[str, ...]


@cache
def registry() -> Registry:
    """Everything that is registered here."""
    found: dict[str, list[EntryPoint]] = {}
    unreadable = []
    seen = set()
    for distribution in distributions():
        try:
            name = re.sub(r"[-_.]+", "-", distribution.name or "").lower()
            # The first on sys.path is the one that is imported.
            entries = () if name and name in seen else distribution.entry_points
            ours = [entry for entry in entries if entry.group == GROUP]
        except Exception as error:
            unreadable.append(
                f"the metadata of the distribution {_place(distribution)} cannot be read "
                f"({type(error).__name__}: {error}); simulators in it are not known"
            )
            continue
        seen.add(name)
        for entry in ours:
            found.setdefault(entry.name, []).append(entry)
    broken = {name: reason for name, entries in found.items() if (reason := _fault(name, entries))}
    return Registry(
        {name: found[name][0] for name in sorted(found) if name not in broken},
        broken,
        tuple(unreadable),
    )


def _fault(name: str, entries: list[EntryPoint]) -> str:
    """Why a name cannot be used at all; nothing when it can."""
    if name in RESERVED or not re.fullmatch(r"[\w-]{1,100}", name, re.ASCII):
        return (
            f"{_owner(entries[0])} registers a simulator as {name[:100]!r}, which cannot be its "
            "name: use letters, digits, _ and - (not all, not none)"
        )
    if len({entry.value for entry in entries}) > 1:
        registered = " and ".join(f"{_owner(entry)} ({entry.value})" for entry in entries)
        return f"{name} is registered by {registered}; uninstall or rename one of them"
    return ""


def _owner(entry: EntryPoint) -> str:
    distribution = entry.dist
    if distribution is None:
        return "a distribution without a name"
    return f"{distribution.name or _place(distribution)} {distribution.version or ''}".strip()


def _place(distribution: Distribution) -> str:
    return str(getattr(distribution, "_path", "without a place"))


@cache
def registered() -> dict[str, EntryPoint]:
    """Entry points by simulator name, sorted, of all adapters that can be imported."""
    return {name: entry for name, entry in registry().entries.items() if not problem(name)}


def known() -> list[str]:
    """All names that may be asked for, the broken ones too, sorted."""
    return sorted({*registry().entries, *registry().broken})


def check_names(names: Iterable[str]) -> None:
    """Raise `UnknownSimulatorError` for the first name that is not registered, whatever version of
    it is meant."""
    for name in names:
        if base_name(name) not in known():
            raise UnknownSimulatorError(
                f"unknown simulator {name!r}; choose from {', '.join(known())}, or all"
            )


@cache
def problem(name: str) -> str | None:
    """Why the adapter of a known simulator cannot be used; None when it can."""
    try:
        adapter(name)
    except SimulatorError as error:
        return str(error)
    return None


def address(name: str) -> str | None:
    """`module:Class` of a simulator's adapter, for its worker; None of one that is not usable."""
    entry = registered().get(base_name(name))
    return None if entry is None else entry.value


@cache
def adapter(name: str) -> type[Simulator]:
    """The adapter class of a simulator. Its engine is not imported.

    Of a version (`mysim==3.3.7`) it is the same class with an `info` of its own.

    Raises:
        UnknownSimulatorError: the message lists the known names.
        SimulatorError: the adapter cannot be used; the message says whose it is and why.
    """
    check_names([name])
    version = VersionedName.of(name)
    if version.kind:
        cls = adapter(version.base)
        place = {"__module__": cls.__module__, "__qualname__": cls.__qualname__}
        return type(cls.__name__, (cls,), {**place, "info": cls.info.of_version(version)})
    if name in registry().broken:
        raise SimulatorError(registry().broken[name])
    entry = registry().entries[name]
    whose = f"the adapter of {name} ({entry.value}, of {_owner(entry)})"
    try:
        cls = entry.load()
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # sys.exit in a module, for instance
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise SimulatorError(f"{whose} does not import: {reason[:300]}") from error
    if not (isinstance(cls, type) and issubclass(cls, Simulator)):
        raise SimulatorError(f"{whose} is no Simulator subclass")
    if not isinstance(getattr(cls, "info", None), SimulatorInfo):
        raise SimulatorError(f"{whose} has no SimulatorInfo in its attribute info")
    if not (isinstance(getattr(cls, "profiles", None), Mapping) and cls.profiles):
        raise SimulatorError(f"{whose} has no settings in its attribute profiles")
    if cls.info.name != name:
        raise SimulatorError(f"{whose} says in its info that its name is {cls.info.name!r}")
    if wrong := flaw(cls.profiles):
        raise SimulatorError(f"{whose} has wrong settings: {wrong}")
    return cls


def settings_of(name: str, profile_name: str, changes: Mapping[str, Any]) -> Settings:
    """The settings of a simulator: those of a profile, some of them changed.

    Raises:
        SimulatorError: as `adapter`.
        SettingsError: it has no such profile, or cannot take a change.
    """
    return changed(profile(adapter(name).profiles, profile_name, name), changes, name)


def seeds_seen(adapter: str, profile: str) -> tuple[Seen, ...]:
    """What the adapter `module:Class` says of a profile; nothing where it says nothing."""
    module, _, name = adapter.partition(":")
    try:
        declared = getattr(importlib.import_module(module), name).chosen_on
    except (ImportError, AttributeError):  # an adapter that only its own interpreter can import
        return ()
    return tuple(declared.get(profile, ()))
