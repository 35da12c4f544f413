"""The record of one repetition: what it was, what came of it, what it cost, as one JSON line."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any, Literal, NamedTuple, TypedDict

from pytest_simbench.records import checked
from pytest_simbench.records.checked import Count, Name, Number, Positive, Size
from pytest_simbench.records.metrics import COSTS, CRASHED, Metric
from pytest_simbench.records.notes import Notes
from pytest_simbench.records.upgrade import upgraded

SCHEMA = 2
"""Of the lines that are written; lines of older ones are read too, see `upgrade`."""

Status = Literal["ok", "failed", "interrupted"]
"""How a repetition ended; one that failed is said to have crashed."""


class RecordError(ValueError):
    """A line that is no record; the message names file, line and what is wrong with it."""


@dataclass(frozen=True)
class Failure:
    """Why a repetition did not end well.

    Attributes:
        type: name of the typed error, for instance `WorkerHung`.
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


class Who(NamedTuple):
    """What did a repetition: a simulator as named, its mode and profile."""

    simulator: str
    mode: str
    profile: str


@dataclass(frozen=True)
class Record:
    """One repetition: what it was, what came of it, and what it cost.

    Times are wall seconds unless said otherwise. A metric that is not available is None. Keys of a
    newer plugin are kept in `extra` and written back. What must be equal for two records to belong
    together stands in `records.configuration`.

    Attributes:
        test: id of the test, as pytest has it; only shown and compared as a whole.
        function: the test's id without its parameters.
        simulator: as the user named it, with the version that was asked for: `name==3.3.7`.
        version: the release or build that was asked for; empty: what is installed.
        variant: the test's parameters besides simulator, mode, profile, robot and time step, as
            the id has them.
        details: what explains the score; the task's alone.
        notes: what the tool notes.
        reasons: why the score is no better, in the task's words.
        scene: digest of the task's scene for one seed and no jitter; empty where not known.
        task_code: digest of the source of a task of the user's; empty for one of ours.
        robot: its `name` and the `digest` of its description; empty for the task's own robot.
        limits: `timeout`, `stall_timeout` [s] and `memory_limit` [MB]; empty where not known.
        attempt: how often this process had begun the same repetitions, with this time: a plugin
            that reruns failed tests, or a test that repeats a task twice. The last one counts.
    """

    test: Name
    function: Name
    task: Name
    simulator: Name
    mode: Name
    profile: Name
    repetition: Count
    seed: Count
    status: Status
    version: Name = ""
    variant: Name = ""
    protocol: Name = "fast"
    jitter: Size = 0.0
    error: Failure | None = None
    metrics: Mapping[str, Number | bool | None] = field(default_factory=dict)
    details: Mapping[str, Any] = field(default_factory=dict)
    notes: Notes = field(default_factory=Notes)
    reasons: tuple[str, ...] = ()
    seconds: Mapping[str, Number] = field(default_factory=dict)
    stepping: Mapping[str, Number] = field(default_factory=dict)
    timeline: Mapping[str, Number] = field(default_factory=dict)
    resources: Mapping[str, Any] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    scene: Name = ""
    task_code: Name = ""
    robot: Mapping[str, str] = field(default_factory=dict)
    limits: Mapping[str, float | None] = field(default_factory=dict)
    attempt: Positive = 1
    host: Mapping[str, Any] = field(default_factory=dict)
    deviations: tuple[Name, ...] = ()
    contended: bool = False
    reused_worker: bool = False
    extra: Mapping[str, Any] = field(default_factory=dict)

    @property
    def ok(self) -> bool:
        return self.status == "ok"

    @property
    def who(self) -> Who:
        return Who(self.simulator, self.mode, self.profile)

    @property
    def label(self) -> str:
        """Simulator, mode and profile, as messages name them."""
        return f"{self.simulator} {self.mode} ({self.profile})"

    @property
    def name(self) -> str:
        """The test's id without file and class."""
        return self.test[len(self.function) - len(self.function.rpartition("::")[2]) :]

    @property
    def swept(self) -> bool:
        """Whether it was made at another time step than its profile's own."""
        return self.notes.own_timestep is not None

    def noting(self, **notes: Any) -> Record:
        """The same record with other notes."""
        return replace(self, notes=replace(self.notes, **notes))

    def value(self, metric: Metric) -> float | None:
        """What it counts with at a metric of its task, a cost, or `CRASHED`; None where it has no
        value.

        A crashed repetition counts with the worst value, where the metric has one
        (`Metric.crashed`), but by the study's rules (`--protocol paper`), which leave it out. The
        costs of a crashed repetition are none.
        """
        if metric is CRASHED:
            return None if self.status == "interrupted" else float(not self.ok)
        if self.ok:
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
            value = getattr(self, item.name)
            if item.name != "extra" and (value or item.name not in ("robot", "task_code")):
                data[item.name] = value
        data["error"] = None if self.error is None else asdict(self.error)
        noted = asdict(self.notes)
        data["notes"] = {f.name: noted[f.name] for f in fields(Notes) if noted[f.name] != f.default}
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
        try:
            schema = checked.schema(data, SCHEMA)
            whole: dict[str, Any] = checked.plain(dict(data))
            if schema < 2:
                whole = upgraded(whole)
            extra = {k: whole.pop(k) for k in whole.keys() - _KEYS}
            whole = {k: v for k, v in whole.items() if v is not None}
            for name in _TIMES & whole.keys():
                whole[name] = _known(whole[name])
            found = checked.convert(whole, cls)
            if "metrics" not in whole:
                raise checked.CheckError("there is no 'metrics'")
            checked.convert(found.resources, Use, "resources")
        except checked.CheckError as error:
            raise RecordError(f"{where}: {error}") from None
        extra.pop("schema", None)
        shared = {name: _shared(getattr(found, name)) for name in _SHARED}
        return replace(found, extra=extra, **shared)

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


class Use(TypedDict, total=False):
    """What `client.resources` writes, of the whole repetition and of its phases."""

    cpu_percent: dict[str, Number | None] | None
    rss_mb: dict[str, Number | None] | None
    samples: Count | None
    phases: dict[str, Use] | None


_KEYS = frozenset(f.name for f in fields(Record)) - {"extra"}
_TIMES = frozenset({"seconds", "stepping", "timeline"})
_SHARED = ("settings", "versions", "robot", "limits", "host", "deviations")
"""What records of a run have in common."""

_MOST_SHARED = 1000
_known_values: dict[str, Any] = {}


def _known(times: Any) -> Any:
    """Without those that are no number: such were NaN or infinite when they were written."""
    return {k: v for k, v in times.items() if v is not None} if isinstance(times, dict) else times


def _shared(value: Any) -> Any:
    """The same object for equal values: those of a run's records are nearly all equal, and a
    hundred thousand records then have one of each."""
    key = repr(value)
    if len(_known_values) >= _MOST_SHARED:
        _known_values.clear()
    return _known_values.setdefault(key, value)


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
