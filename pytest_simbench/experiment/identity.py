"""What a case and a task say of their records before anything has run."""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Mapping
from contextlib import suppress
from functools import cache, lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from pytest_simbench import __version__
from pytest_simbench.experiment.case import Case
from pytest_simbench.records.names import file_name
from pytest_simbench.records.record import Record
from pytest_simbench.tasks.base import Jitter, Task


def expected(case: Case, task: Task, number: int = 1) -> Record:
    """The record of a repetition that has not begun: everything about it that is known here.

    Settings are those of the adapter's profile with the case's changes; versions those installed
    here or in the engine's own environment. What only a worker can tell is absent.

    Args:
        case: of the repetition.
        task: as it is performed, its smallest version where the protocol asks for that.
        number: of the repetition, from 1.
    """
    return Record(
        test=case.test,
        task=task.name,
        simulator=case.simulator,
        mode=case.mode,
        profile=case.profile,
        repetition=number,
        seed=case.seed + number - 1,
        status="interrupted",
        protocol=case.protocol.name,
        jitter=case.jitter,
        settings={**settings(case), **task.parameters()},
        versions={"pytest-simbench": __version__, **versions(case)},
        scene=scene_digest(task),
        limits=limits(case, task),
        contended=case.contended,
        attempt=case.attempt,
    )


def limits(case: Case, task: Task) -> dict[str, float | None]:
    """Time-outs [s] and the limit of memory [MB]."""
    return {
        "timeout": case.timeout or task.study_timeout,
        "stall_timeout": case.stall_timeout,
        "memory_limit": case.memory_limit,
    }


def settings(case: Case) -> dict[str, Any]:
    """The simulator's settings; empty for an adapter that is not registered under its name."""
    from pytest_simbench.simulator.registry import adapter, registered
    from pytest_simbench.simulator.settings import changed, profile

    entry = registered().get(case.simulator)
    if entry is None or entry.value != case.adapter:
        return {}  # its module may do anything when it is imported
    found = profile(adapter(case.simulator).profiles, case.profile, case.simulator)
    return changed(found, case.changes, case.simulator).to_wire()


def versions(case: Case) -> dict[str, str]:
    """The engine's version, where it is installed here or in its own environment."""
    from pytest_simbench.client.environments import Environment
    from pytest_simbench.simulator.registry import adapter, registered

    entry = registered().get(case.simulator)
    if entry is None or entry.value != case.adapter or case.spec:
        return {}
    info = adapter(case.simulator).info
    environment = Environment.of(info)
    if case.python is None:
        here = {"python": platform.python_version()}
        with suppress(PackageNotFoundError):
            here[info.distribution] = version(info.distribution)
        return here
    if info.requirements and Path(case.python) == environment.python:
        found = environment.version()
        return {info.distribution: found} if found else {}
    return {}  # somebody's own interpreter


def scene_digest(task: Task) -> str:
    """Twelve digits of what the task builds for one seed without jitter; empty if it builds none.

    A robot's files count with their content, not their place.
    """
    try:
        return _scene_digest(task)
    except TypeError:  # a task with a list among its parameters
        return _scene_digest.__wrapped__(task)


@lru_cache(maxsize=16)
def _scene_digest(task: Task) -> str:
    try:
        wire = task.scene(0, Jitter(0.0, 0.0)).to_wire()
        robot = wire.get("robot")
        if robot:
            kept = {key: value for key, value in robot.items() if key != "packages"}
            wire["robot"] = {**kept, **{k: _content(robot[k]) for k in ("urdf", "srdf")}}
        data = json.dumps(wire, sort_keys=True, default=str)
    except Exception:  # a task may refuse this seed; then nothing is known
        return ""
    return hashlib.sha256(data.encode()).hexdigest()[:12]


@cache
def _content(path: str) -> str:
    try:
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()
    except OSError:
        return ""


def file_stem(case: Case, task: Task, number: int) -> str:
    """The name of a repetition's log and trace, without folder and ending; no other has it."""
    return _stem(case.test, task.name, task.parameters(), number, case.attempt)


def file_stem_of(record: Record) -> str:
    """The same for a record, as its run named them."""
    task = {key: value for key, value in record.settings.items() if key.startswith("task.")}
    return _stem(record.test, record.task, task, record.repetition, record.attempt)


def _stem(test: str, task: str, of_task: Mapping[str, Any], number: int, attempt: int) -> str:
    told = json.dumps(of_task, sort_keys=True, default=list)
    name = file_name(test.rpartition("::")[2], test, task, told)
    return f"{name}-{number}" if attempt == 1 else f"{name}-{number}-attempt-{attempt}"
