"""Settings profiles of a user's TOML files, told apart by name and content."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from pytest_simbench.ground.errors import SettingsError, SimulatorError
from pytest_simbench.ground.files import FileError, read_file
from pytest_simbench.ground.names import file_name
from pytest_simbench.ground.versions import base_name
from pytest_simbench.records.checked import convert, plain
from pytest_simbench.records.tuned_on import Seen
from pytest_simbench.simulator.registry import seeds_seen, settings_of
from pytest_simbench.simulator.settings import Settings

ENDING = ".toml"
"""By which a file is told from the name of a profile."""

LARGEST_FILE = 2**20
"""[bytes]"""

KEYS = ("simulator", "base", "settings", "chosen")


@dataclass(frozen=True)
class ProfileFile:
    """A profile that a file holds, checked.

    Attributes:
        simulator: whose settings they are, without a version.
        base: the adapter's profile that it begins with.
    """

    path: str
    simulator: str
    base: str
    changes: Mapping[str, Any]
    chosen_on: tuple[Seen, ...] = field(default=(), compare=False)

    @cached_property
    def label(self) -> str:
        """Its name in ids and records: the file's, and ten digits of all settings."""
        told = json.dumps(self.settings().to_wire(), sort_keys=True)
        return file_name(Path(self.path).stem, self.simulator, told)

    def settings(self, simulator: str = "", changes: Mapping[str, Any] | None = None) -> Settings:
        """All of them, some changed once more; for a release of the simulator too.

        Raises:
            SettingsError: it is another simulator, or cannot take a change.
        """
        name = simulator or self.simulator
        if base_name(name) != self.simulator:
            raise SettingsError(f"{self.path} is a profile of {self.simulator}, not of {name}")
        return settings_of(name, self.base, {**self.changes, **(changes or {})})

    def seen(self, adapter: str) -> tuple[Seen, ...]:
        """On what they were chosen, with what its base was chosen on."""
        return (*seeds_seen(adapter, self.base), *self.chosen_on)


def read_profile(path: str | Path) -> ProfileFile:
    """The profile of a file: `simulator`, `base` (a profile of it; `default` where there is none),
    the table `[settings]`, and `[chosen]`, of which `seeds` (lists of task, first and last seed)
    are read and the rest is the reader's own.

    Raises:
        SettingsError: the file cannot be used; one sentence.
    """
    try:
        data = tomllib.loads(read_file(path, LARGEST_FILE, "the profile").decode("utf-8-sig"))
    except FileError as error:
        raise SettingsError(str(error)) from None
    except (ValueError, RecursionError) as error:
        raise SettingsError(f"{path} is no TOML file: {' '.join(str(error).split())}") from None
    if unknown := sorted(data.keys() - set(KEYS)):
        raise SettingsError(
            f"{path}: {unknown[0]!r:.60} means nothing here; choose from {', '.join(KEYS)}"
        )
    simulator, base = data.get("simulator"), data.get("base", "default")
    changes, chosen = data.get("settings", {}), data.get("chosen", {})
    if not (isinstance(simulator, str) and isinstance(base, str)):
        raise SettingsError(f"{path}: give texts: simulator = NAME, and base = PROFILE if need be")
    if not (isinstance(changes, dict) and isinstance(chosen, dict)):
        raise SettingsError(f"{path}: settings and chosen are tables, [settings] and [chosen]")
    seeds = chosen.get("seeds", [])
    try:
        seen = tuple(
            convert(plain({"task": task, "first": first, "last": last}), Seen)
            for task, first, last in seeds
        )
        if any(given.first > given.last for given in seen):
            raise ValueError
    except (TypeError, ValueError):
        why = "seeds are lists [TASK, FIRST, LAST], FIRST at most LAST"
        raise SettingsError(f"{path}: {why}") from None
    found = ProfileFile(str(path), base_name(simulator), base, changes, seen)
    try:
        found.settings()
    except SimulatorError as error:
        raise SettingsError(f"{path}: {error}") from None
    return found


def write_profile(
    base: str, simulator: str, changes: Mapping[str, Any], chosen: Mapping[str, Any]
) -> str:
    """The text of such a file."""
    lines = [f"simulator = {_text(simulator)}", f"base = {_text(base)}", "", "[settings]"]
    lines += [f"{key} = {_text(value)}" for key, value in changes.items()]
    lines += ["", "[chosen]", *(f"{key} = {_text(value)}" for key, value in chosen.items())]
    return "\n".join(lines) + "\n"


def _text(value: Any) -> str:
    """A value as TOML has it: of these kinds as JSON, but for tables."""
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{json.dumps(k)} = {_text(v)}' for k, v in value.items())} }}"
    return json.dumps("none" if value is None else value, ensure_ascii=False)
