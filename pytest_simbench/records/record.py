"""The record of one repetition: what it was, what came of it, what it cost, as one JSON line."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, field, fields
from typing import Any, Literal, get_args

from pytest_simbench.records import checked
from pytest_simbench.records.metrics import COSTS, Metric

SCHEMA = 1

OWN_TIMESTEP = "own_timestep"
"""Of the details of a record of a sweep: the time step that its profile has [s], where its own is
another one."""

Status = Literal["ok", "failed", "interrupted"]


class RecordError(ValueError):
    """A line that is no record; the message names file, line and what is wrong with it."""


@dataclass(frozen=True)
class Failure:
    """Why a repetition did not end well.

    Attributes:
        type: name of the typed error, for instance `WorkerHung`.
        message: one sentence.
        phase: what the repetition was doing, for instance `settle`.
        log_tail: the last lines of the worker's log.
    """

    type: str
    message: str = ""
    phase: str = ""
    log_tail: str = ""

    @property
    def cause(self) -> str:
        """Type and phase: what failures are counted by."""
        return f"{self.type} in {self.phase}" if self.phase else self.type


@dataclass(frozen=True)
class Record:
    """One repetition: what it was, what came of it, and what it cost.

    Times are wall seconds unless said otherwise. A metric that is not available is None. Keys of a
    newer plugin are kept in `extra` and written back. What must be equal for two records to belong
    together stands in `records.configuration`.

    Attributes:
        scene: digest of the task's scene for one seed and no jitter; empty where not known.
        robot: its `name` and the `digest` of its description; empty for the task's own robot.
        limits: `timeout`, `stall_timeout` [s] and `memory_limit` [MB]; empty where not known.
        attempt: how often this process had begun the same repetitions, with this time: a plugin
            that reruns failed tests, or a test that repeats a task twice. The last one counts.
    """

    test: str
    task: str
    simulator: str
    mode: str
    profile: str
    repetition: int
    seed: int
    status: Status
    protocol: str = "fast"
    jitter: float = 0.0
    error: Failure | None = None
    metrics: Mapping[str, float | None] = field(default_factory=dict)
    details: Mapping[str, Any] = field(default_factory=dict)
    seconds: Mapping[str, float] = field(default_factory=dict)
    stepping: Mapping[str, float] = field(default_factory=dict)
    timeline: Mapping[str, float] = field(default_factory=dict)
    resources: Mapping[str, Any] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    scene: str = ""
    robot: Mapping[str, str] = field(default_factory=dict)
    limits: Mapping[str, float | None] = field(default_factory=dict)
    attempt: int = 1
    host: Mapping[str, Any] = field(default_factory=dict)
    deviations: tuple[str, ...] = ()
    contended: bool = False
    reused_worker: bool = False
    extra: Mapping[str, Any] = field(default_factory=dict)

    @property
    def ok(self) -> bool:
        return self.status == "ok"

    @property
    def label(self) -> str:
        """Simulator, mode and profile, as messages name them."""
        return f"{self.simulator} {self.mode} ({self.profile})"

    @property
    def swept(self) -> bool:
        """Whether it was made at another time step than its profile's own."""
        return OWN_TIMESTEP in self.details

    def value(self, metric: Metric) -> float | None:
        """What it counts with at a metric of its task, or at a cost; None where it has no value.

        A crashed repetition counts with the worst value, where the metric has one
        (`Metric.crashed`), but by the study's rules (`--protocol paper`), which leave it out. The
        costs of a crashed repetition are none.
        """
        if self.status == "ok":
            found = self.metrics.get(metric.name)
            return self.cost(metric.name) if found is None and metric in COSTS else found
        counts = self.status == "failed" and self.protocol != "paper"
        return metric.crashed if counts else None

    def cost(self, name: str) -> float | None:
        """One of `metrics.COSTS` by name, or None where the record does not hold it."""
        return _COSTS[name](self)

    def to_dict(self) -> dict[str, Any]:
        """Plain data in a fixed order of keys; numbers that JSON does not have become None."""
        data: dict[str, Any] = {"schema": SCHEMA}
        for item in fields(self):
            if item.name != "extra" and not (item.name == "robot" and not self.robot):
                data[item.name] = getattr(self, item.name)
        if self.error is not None:
            data["error"] = {f.name: getattr(self.error, f.name) for f in fields(self.error)}
        found: dict[str, Any] = plain({**data, **self.extra})
        return found

    def to_json(self) -> str:
        """One line of ASCII, without its line end."""
        return json.dumps(self.to_dict(), allow_nan=False)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], where: str = "record") -> Record:
        """The record in `data`; `where` names it in messages.

        Raises:
            RecordError: a key is missing or of the wrong type, or the schema is a newer one.
        """
        schema = data.get("schema", SCHEMA)
        if not isinstance(schema, int) or not 0 < schema <= SCHEMA:
            raise RecordError(
                f"{where}: schema {checked.short(schema)} was written by a newer pytest-simbench "
                f"(this one reads up to {SCHEMA}); update it"
            )
        try:
            whole: dict[str, Any] = checked.plain(dict(data))
            known = _known(whole)
        except checked.CheckError as error:
            raise RecordError(f"{where}: {error}") from None
        except RecursionError:
            raise RecordError(f"{where}: the record is nested too deeply") from None
        extra = {k: v for k, v in whole.items() if k not in known and k not in ("schema", "error")}
        return cls(**known, extra=extra)

    @classmethod
    def from_json(cls, line: str | bytes, where: str = "record") -> Record:
        """The record in one line.

        Raises:
            RecordError: not JSON, not an object, or not a record.
        """
        try:
            data = json.loads(line)
        except (ValueError, RecursionError) as error:
            raise RecordError(f"{where}: not JSON ({error})") from None
        if not isinstance(data, dict):
            raise RecordError(f"{where}: a record is a JSON object, not {type(data).__name__}")
        return cls.from_dict(data, where)


def _known(data: dict[str, Any]) -> dict[str, Any]:
    """The arguments of a record, checked."""
    known = {f.name: data[f.name] for f in fields(Record) if f.name in data and f.name != "extra"}
    for name, types in _TYPES.items():
        if name not in known:
            if name in _REQUIRED:
                raise checked.CheckError(f"the record has no {name!r}")
        elif not isinstance(known[name], types) or (
            isinstance(known[name], bool) and bool not in types
        ):
            wanted = " or ".join(kind.__name__ for kind in types)
            raise checked.CheckError(f"{name!r} must be {wanted}, not {type(known[name]).__name__}")
    if known["status"] not in get_args(Status):
        valid = ", ".join(get_args(Status))
        raise checked.CheckError(f"status {checked.short(known['status'])} is none of {valid}")
    for name in _OBJECTS:
        known[name] = known.get(name) or {}
    for name in _NAMES:
        checked.name(known.get(name, ""), name)
    for name in ("repetition", "seed", "jitter"):
        checked.number(known.get(name), name, least=0)
    checked.number(known.get("attempt"), "attempt", least=1)
    for name, value in known["metrics"].items():
        if not isinstance(value, int | float | None):
            raise checked.CheckError(
                f"metric {name!r} must be a number, not {checked.short(value)}"
            )
    for name in ("seconds", "stepping", "timeline", "limits"):
        checked.numbers(known[name], name)
    for name in ("versions", "robot"):
        checked.texts(known[name], name)
    checked.texts({k: v for k, v in known["details"].items() if k in _TEXT_DETAILS}, "details")
    checked.use_of_resources(known["resources"], "resources")
    deviations = known.get("deviations") or ()
    known["deviations"] = tuple(checked.name(text, "deviations") for text in deviations)
    if known.get("error") is not None:
        known["error"] = _failure(known["error"])
    for name in _SHARED:
        known[name] = _shared(known[name])
    return known


_known_values: dict[str, Any] = {}


def _shared(value: Any) -> Any:
    """The same object for equal values: those of a run's records are nearly all equal, and a
    hundred thousand records then have one of each."""
    key = repr(value)
    if len(_known_values) >= _MOST_SHARED:
        _known_values.clear()
    return _known_values.setdefault(key, value)


def _failure(error: Mapping[str, Any]) -> Failure:
    if not isinstance(error.get("type"), str):
        raise checked.CheckError("'error' has no 'type'")
    found = {f.name: error[f.name] for f in fields(Failure) if f.name in error}
    for name, value in found.items():
        if not isinstance(value, str | None):
            raise checked.CheckError(f"'error.{name}' must be str, not {type(value).__name__}")
    return Failure(**{name: value or "" for name, value in found.items()})


_REQUIRED = (
    *(f.name for f in fields(Record) if f.default is MISSING and f.default_factory is MISSING),
    "metrics",
)
_NAMES = ("test", "task", "simulator", "mode", "profile", "protocol", "scene")
_TEXT_DETAILS = ("log", "untested", "closing")
_OBJECTS = tuple(
    f.name
    for f in fields(Record)
    if f.default_factory is dict and f.name not in ("metrics", "extra")
)
_SHARED = ("settings", "versions", "robot", "limits", "host", "deviations")
"""What records of a run have in common."""

_MOST_SHARED = 1000
_TYPES: dict[str, tuple[type, ...]] = {
    **dict.fromkeys((*_NAMES, "status"), (str,)),
    **dict.fromkeys(("repetition", "seed", "attempt"), (int,)),
    "jitter": (int, float),
    "error": (dict, type(None)),
    "metrics": (dict,),
    **dict.fromkeys(_OBJECTS, (dict, type(None))),
    "deviations": (list, type(None)),
    **dict.fromkeys(("contended", "reused_worker"), (bool,)),
}


def _ratio(over: float | None, under: float | None) -> float | None:
    return over / under if over is not None and under is not None and under > 0 else None


def _resource(record: Record, name: str, what: str) -> float | None:
    found: float | None = (record.resources.get(name) or {}).get(what)
    return found


_COSTS: dict[str, Callable[[Record], float | None]] = {
    "rtf": lambda r: _ratio(r.stepping.get("simulated"), r.stepping.get("wall")),
    "cpu_cost": lambda r: _ratio(r.stepping.get("cpu"), r.stepping.get("simulated")),
    "cpu": lambda r: _resource(r, "cpu_percent", "mean"),
    "ram": lambda r: _resource(r, "rss_mb", "mean"),
    "ram_peak": lambda r: _resource(r, "rss_mb", "peak"),
    "start": lambda r: r.timeline.get("start"),
    "end": lambda r: r.timeline.get("end"),
    "total": lambda r: r.seconds.get("total"),
}


def plain(value: Any) -> Any:
    """`value` as JSON can hold it: numpy scalars and arrays, tuples, paths, NaN and infinity."""
    if isinstance(value, Mapping):
        return {checked.writable(str(key)): plain(item) for key, item in value.items()}
    if isinstance(value, set | frozenset):
        return sorted(checked.writable(str(item)) for item in value)
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, str):
        return checked.writable(value)
    if value is None or isinstance(value, bool | int):
        return value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if hasattr(value, "tolist"):  # numpy, which this module does not import
        return plain(value.tolist())
    return checked.writable(str(value))
