"""Records as a small run would leave them, with round numbers that can be checked by hand."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping
from typing import Any

from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.record import Failure, Record
from pytest_simbench.report.model.document import Column
from tests.records import build

STACKING = (
    Metric("placed", "placed", "", "higher", "share", 15, study=True),
    Metric("at_end", "at the end", "", "higher", "share", 15, study=True),
    Metric("placed_strict", "placed strict", "", "higher", "share", 15),
    Metric("at_end_strict", "at the end strict", "", "higher", "share", 15),
    Metric("towers", "towers", "", "higher", "share", 3),
    Metric("untouched_moved", "untouched moved", "cubes", "lower"),
    Metric("failed_picks", "failed picks", "", "lower"),
)
THROWING = (
    Metric("moved", "moved", "", "higher", "share", 6, study=True),
    Metric("hit", "hit", "", "higher", "yes_no"),
    Metric("lost_in_transit", "lost in transit", "", "lower", "yes_no"),
    Metric("landing_x", "landing x", "m", None),
    Metric("landing_error", "landing error", "m", "lower"),
    Metric("release_position_error", "release position error", "m", "lower"),
    Metric("release_speed", "release speed", "m/s", None),
    Metric("release_velocity_error", "release velocity error", "m/s", "lower"),
    Metric("release_time_error", "release time error", "s", "lower"),
)
METRICS = {"stacking": STACKING, "throwing": THROWING}
REFERENCES = {"throwing": {"landing_x": 1.352, "release_speed": 2.753}}


def texts(columns: Iterable[Column]) -> dict[str, list[str]]:
    """A table by its headings, each cell in one line."""
    return {column.heading: [cell.text for cell in column.cells] for column in columns}


def text(block: str) -> str:
    """What a terminal shows, as it stands in a test."""
    return textwrap.dedent(block).strip("\n")


def record(
    simulator: str = "mujoco",
    repetition: int = 1,
    task: str = "stacking",
    mode: str = "headless",
    profile: str = "tuned",
    metrics: Mapping[str, float | None] | None = None,
    **changes: Any,
) -> Record:
    """A repetition that took 10 s, stepped 8 s of them for 160 simulated seconds."""
    seconds = {"launch": 0.5, "load": 0.3, "plan": 1.0, "step": 8.0, "other": 0.2, "total": 10.0}
    given: dict[str, Any] = {
        "test": f"test_{task}[{simulator}-{mode}]",
        "task": task,
        "simulator": simulator,
        "mode": mode,
        "profile": profile,
        "seconds": seconds,
        "stepping": {"wall": 8.0, "cpu": 7.6, "steps": 40000, "simulated": 160.0},
        "timeline": {"start": 0.8, "end": 9.8},
        "deviations": ("rolling friction is not modelled",) if simulator == "pybullet" else (),
        **{name: {} for name in ("settings", "versions", "host")},
    }
    return build.record(repetition, metrics=dict(metrics or {}), **{**given, **changes})


def failed(kind: str, phase: str, message: str, **given: Any) -> Record:
    """A repetition that ended in an error."""
    return record(status="failed", error=Failure(kind, message, phase, "step 3\ndied\n"), **given)


def stacking_run(mode: str = "headless") -> list[Record]:
    """20 repetitions on two simulators; three of the second's failed."""
    records = []
    for k in range(1, 21):
        good = {
            "placed": 1.0 if k % 5 else 14 / 15,
            "at_end": 1.0 if k % 4 else 13 / 15,
            "placed_strict": 1.0 if k % 3 else 14 / 15,
            "at_end_strict": 1.0 if k % 3 else 13 / 15,
            "towers": 1.0 if k % 3 else 2 / 3,
            "untouched_moved": 0.0,
            "failed_picks": float(k == 7),
        }
        poor = {
            **good,
            "placed": (10 + k % 4) / 15,
            "at_end": (12 + k % 4) / 15,
            "untouched_moved": float(k % 2),
        }
        records.append(record("mujoco", k, mode=mode, metrics=good))
        if k in (3, 8, 9):
            kind = (
                ("WorkerHung", "settle", "no answer within 60 s")
                if k != 3
                else ("WorkerDied", "pick", "the worker was killed by SIGSEGV")
            )
            records.append(failed(*kind, simulator="pybullet", repetition=k, mode=mode))
        else:
            records.append(record("pybullet", k, mode=mode, metrics=poor))
    return records


def throwing_run() -> list[Record]:
    """20 repetitions on two simulators; the second's first lost the cube."""
    records = []
    for simulator, shift in (("mujoco", 0.004), ("pybullet", -0.03)):
        for k in range(1, 21):
            lost = simulator == "pybullet" and k == 1
            landing = 1.352 + shift + 0.001 * (k % 5)
            records.append(
                record(
                    simulator,
                    k,
                    "throwing",
                    metrics={
                        "moved": 0.0 if lost else (2 + k % 2) / 6,
                        "hit": 0.0 if lost else 1.0,
                        "lost_in_transit": float(lost),
                        "landing_x": None if lost else landing,
                        "landing_error": None if lost else abs(landing - 1.352),
                        "release_position_error": 0.004 + 0.0001 * k,
                        "release_speed": 2.74,
                        "release_velocity_error": 0.02,
                        "release_time_error": 0.0 if simulator == "mujoco" else 0.002,
                    },
                )
            )
    return records
