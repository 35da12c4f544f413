"""Records for the tests of this room."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.record import Failure, Record
from pytest_simbench.records.upgrade import taken_apart

METRICS = (
    Metric("placed", "placed", kind="share", of=15, study=True),
    Metric("hit", "hit", kind="yes_no"),
    Metric("landing_error", "landing error", "m", better="lower"),
    Metric("landing_x", "landing", "m", better=None),
)


def record(
    repetition: int = 0, *, metrics: dict[str, float | None] | None = None, **changes: Any
) -> Record:
    """A record of stacking on a simulator called engine."""
    given: dict[str, Any] = {
        "test": "test_stacking[engine-headless]",
        "task": "stacking",
        "simulator": "engine",
        "mode": "headless",
        "profile": "tuned",
        "repetition": repetition,
        "seed": 1000 + repetition,
        "status": "ok",
        "metrics": metrics or {},
        "seconds": {"step": 8.0, "total": 9.5},
        "stepping": {"wall": 8.0, "cpu": 7.9, "steps": 35000, "simulated": 140.0},
        "timeline": {"start": 1.2, "end": 9.0},
        "resources": {
            "cpu_percent": {"mean": 99.0, "std": 3.0},
            "rss_mb": {"mean": 150.0, "std": 2.0, "peak": 161.0},
            "samples": 80,
        },
        "settings": {"timestep": 0.002},
        "versions": {"engine": "1.0"},
        "host": {"cpu": "some", "cores": 2},
    }
    return made({**given, **changes})


def made(given: dict[str, Any]) -> Record:
    """A record, with function and variant as its test's id has them."""
    robot = given.get("robot", {}).get("name", "")
    names = (given[key] for key in ("test", "simulator", "mode", "profile"))
    function, variant = taken_apart(*names, robot)
    return Record(**{"function": function, "variant": variant, **given})


def records(name: str, values: Sequence[float], **changes: Any) -> list[Record]:
    """One record for each value of a metric."""
    return [record(k, metrics={name: float(value)}, **changes) for k, value in enumerate(values)]


def failed(
    repetition: int, cause: str = "WorkerHung", phase: str = "settle", **changes: Any
) -> Record:
    """A record of a repetition that failed."""
    error = Failure(cause, "no answer for 30 s", phase, "last line")
    return record(repetition, status="failed", error=error, **changes)
