"""Tables of a TOML file that anybody may have written: each value checked as it is taken."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from pytest_simbench.motion.errors import RobotError

T = TypeVar("T")


class FileTable:
    """One table of a file; `close` complains of what nobody took. Messages begin with `where`."""

    def __init__(self, data: Mapping[str, Any], where: str) -> None:
        self.where = where
        self._left = dict(data)
        self._taken: list[str] = []

    def __contains__(self, key: str) -> bool:
        return key in self._left

    def table(self, key: str) -> FileTable:
        """A table in this one, `[key]`; empty where there is none."""
        value = self._take(key, {})
        if not isinstance(value, dict):
            raise self.error(key, "make it a table, with its values below " + f"[{key}]")
        return FileTable(value, f"{self.where}, [{key}]")

    def text(self, key: str) -> str:
        """A text that is not empty."""
        value = self._take(key)
        if not isinstance(value, str) or not value.strip() or "\0" in value:
            raise self.error(key, "give it a text")
        return value

    def texts(self, key: str) -> tuple[str, ...]:
        """A list of texts, each once."""
        value = self._take(key)
        if not isinstance(value, list) or not value or not all(isinstance(v, str) for v in value):
            raise self.error(key, 'give it a list of names, ["joint1", "joint2"]')
        if len(set(value)) < len(value):
            raise self.error(key, "name each once")
        return tuple(value)

    def every(self, key: str, read: Callable[[FileTable, str], T]) -> dict[str, T]:
        """A table whose values are all of one kind: `every("locked", FileTable.number)`."""
        inner = self.table(key)
        return {name: read(inner, name) for name in list(inner._left)}

    def number(self, key: str, default: float | None = None, *, least: float = -1e6) -> float:
        """A finite number of at least `least`."""
        return self._number(key, self._take(key, default), least)

    def flag(self, key: str, default: bool) -> bool:
        """Yes or no."""
        value = self._take(key, default)
        if not isinstance(value, bool):
            raise self.error(key, f"{value!r:.60} is neither true nor false")
        return value

    def some(self, key: str) -> tuple[float, ...]:
        """A list of at least one finite number."""
        value = self._take(key)
        if not isinstance(value, list) or not value:
            raise self.error(key, "give it a list of numbers")
        return tuple(self._number(key, item, -1e6) for item in value)

    def each(
        self, key: str, count: int, default: Any = None, *, least: float = -1e6
    ) -> tuple[float, ...]:
        """So many numbers, or one that holds for all."""
        value = self._take(key, default)
        values = list(value) if isinstance(value, list | tuple) else [value] * count
        if len(values) != count:
            raise self.error(key, f"give it {count} numbers, or one for all; it has {len(values)}")
        return tuple(self._number(key, item, least) for item in values)

    def close(self) -> None:
        """Complain of keys that mean nothing here."""
        if self._left:
            key, valid = next(iter(self._left)), ", ".join(dict.fromkeys(self._taken))
            raise RobotError(f"{self.where}: {key!r:.80} means nothing here; valid: {valid}")

    def error(self, key: str, advice: str) -> RobotError:
        """The error about a value."""
        return RobotError(f"{self.where}: {key}: {advice}")

    def _take(self, key: str, default: Any = None) -> Any:
        self._taken.append(key)
        value = self._left.pop(key, default)
        if value is None:
            raise RobotError(f"{self.where}: {key} is missing")
        return value

    def _number(self, key: str, value: Any, least: float) -> float:
        fine = isinstance(value, int | float) and not isinstance(value, bool)
        if not (fine and math.isfinite(value) and least <= value <= 1e12):
            raise self.error(key, f"{value!r:.60} is no number of at least {least:g}")
        return float(value)
