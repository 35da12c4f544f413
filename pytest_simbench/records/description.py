"""What the numbers of a task mean, as a run folder and a saved benchmark tell it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from math import isfinite
from typing import Any, Protocol, get_args

from pytest_simbench.records import checked
from pytest_simbench.records.metrics import Better, Kind, Metric
from pytest_simbench.records.record import plain

SCHEMA = 1


class TaskDescriptionError(ValueError):
    """What is no description; the message says where, and what is wrong with it."""


class Describing(Protocol):
    """What can be described: a task."""

    @property
    def name(self) -> str: ...

    @property
    def metrics(self) -> tuple[Metric, ...]: ...

    @property
    def references(self) -> Mapping[str, float]: ...


@dataclass(frozen=True)
class TaskDescription:
    """What a task's metrics and references mean.

    Attributes:
        task: its name.
        metrics: what it measures, in the order of its tables.
        references: the value of a perfect simulator, by metric.
    """

    task: str
    metrics: tuple[Metric, ...] = ()
    references: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, task: Describing) -> TaskDescription:
        """What a task says of itself; a reference that is no finite number is none."""
        known = {name: value for name, value in task.references.items() if isfinite(value)}
        return cls(task.name, tuple(task.metrics), known)

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        metrics = [metric.to_wire() for metric in self.metrics]
        data = {"task": self.task, "metrics": metrics, "references": self.references}
        found: dict[str, Any] = plain({"schema": SCHEMA, **data})
        return found

    @classmethod
    def from_dict(cls, data: Any, where: str = "description") -> TaskDescription:
        """The description in `data`; `where` names it in messages.

        Raises:
            TaskDescriptionError: a part of it is missing or of the wrong type, or the schema is a
                newer one.
        """
        try:
            whole = _whole(data)
            metrics = tuple(_metric(item, k) for k, item in enumerate(_list(whole, "metrics"), 1))
            names = [metric.name for metric in metrics]
            if len(set(names)) < len(names):
                raise checked.CheckError("two of the metrics have one name")
            references = whole.get("references") or {}
            if not isinstance(references, dict) or None in references.values():
                raise checked.CheckError("'references' must be numbers by name")
            checked.numbers(references, "references")
            return cls(checked.name(whole.get("task"), "task"), metrics, references)
        except checked.CheckError as error:
            raise TaskDescriptionError(f"{where}: {error}") from None
        except RecursionError:
            raise TaskDescriptionError(f"{where}: it is nested too deeply") from None


@dataclass(frozen=True)
class Threshold:
    """A threshold that a test asked for.

    Attributes:
        test: its id.
        metric: as the test named it.
        value: what it got: its own, or that of `--sim-threshold`.
    """

    test: str
    metric: str
    value: float

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {"schema": SCHEMA, **vars(self)}

    @classmethod
    def from_dict(cls, data: Any, where: str = "threshold") -> Threshold:
        """The threshold in `data`.

        Raises:
            TaskDescriptionError: it is none.
        """
        try:
            whole = _whole(data)
            test, metric = (checked.name(whole.get(key), key) for key in ("test", "metric"))
            if whole.get("value") is None:
                raise checked.CheckError("'value' must be a number")
            checked.number(whole["value"], "value")
        except checked.CheckError as error:
            raise TaskDescriptionError(f"{where}: {error}") from None
        return cls(test, metric, float(whole["value"]))


def _whole(data: Any) -> dict[str, Any]:
    if not isinstance(data, dict):
        raise checked.CheckError(f"a JSON object is wanted, not {type(data).__name__}")
    schema = data.get("schema", SCHEMA)
    if not isinstance(schema, int) or not 0 < schema <= SCHEMA:
        raise checked.CheckError(
            f"schema {checked.short(schema)} was written by a newer pytest-simbench (this one "
            f"reads up to {SCHEMA}); update it"
        )
    found: dict[str, Any] = checked.plain(data)
    return found


def _list(data: Mapping[str, Any], key: str) -> list[Any]:
    found = data.get(key)
    if not isinstance(found, list):
        raise checked.CheckError(f"{key!r} must be list, not {type(found).__name__}")
    return found


def _metric(data: Any, number: int) -> Metric:
    """A metric in a list; what a newer plugin says of it besides is not known here."""
    where = f"metrics.{number}"
    if not isinstance(data, dict):
        raise checked.CheckError(f"{where!r} must be dict, not {type(data).__name__}")
    known = {f.name: data[f.name] for f in fields(Metric) if f.name in data}
    for key in ("name", "title"):
        if not checked.name(known.get(key), f"{where}.{key}"):
            raise checked.CheckError(f"'{where}.{key}' is empty")
    for key in ("unit", "doc"):
        checked.name(known.get(key, ""), f"{where}.{key}")
    checked.one_of(known.get("better", "higher"), f"{where}.better", (*get_args(Better), None))
    checked.one_of(known.get("kind", "value"), f"{where}.kind", get_args(Kind))
    for key, types in (("study", bool), ("of", int | None)):
        if not isinstance(known.get(key, False if key == "study" else None), types):
            raise checked.CheckError(f"'{where}.{key}' is {checked.short(known[key])}")
    checked.number(known.get("of"), f"{where}.of", least=1)
    checked.number(known.get("resolution"), f"{where}.resolution", least=0)
    checked.number(known.get("least"), f"{where}.least")
    try:
        return Metric(**known)
    except ValueError as error:
        raise checked.CheckError(str(error)) from None
