"""What an experiment says of its records before anything has run."""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from pytest_simbench import __version__
from pytest_simbench.client.environments import outside
from pytest_simbench.description.robot_files import CONTENT, robot_cache, with_content
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.experiment import Experiment
from pytest_simbench.ground.names import data_digest, file_name
from pytest_simbench.ground.versions import VersionedName
from pytest_simbench.motion.registry import BUILT_IN, known_robot
from pytest_simbench.records.configuration import text
from pytest_simbench.records.record import Record, Status, plain
from pytest_simbench.records.series import short
from pytest_simbench.scene import Robot
from pytest_simbench.simulator.registry import adapter, address, settings_of
from pytest_simbench.tasks.base import ROBOT, Jitter, Task
from pytest_simbench.tasks.recorded import code_of


def record_of(
    experiment: Experiment,
    number: int,
    *,
    status: Status = "interrupted",
    settings: Mapping[str, Any],
    versions: Mapping[str, str],
    **found: Any,
) -> Record:
    """The record of a repetition, counted from 1: what the experiment says of it, and the fields of
    the record that were found besides."""
    case = experiment.case
    return Record(
        test=case.test,
        function=case.function or case.test,
        variant=case.variant,
        version=VersionedName.of(case.simulator).which,
        task=experiment.task.name,
        simulator=case.simulator,
        mode=case.mode,
        profile=case.profile,
        repetition=number,
        seed=experiment.seed(number),
        status=status,
        protocol=case.protocol.name,
        jitter=case.jitter,
        settings={**settings, **experiment.task.parameters()},
        versions={"pytest-simbench": __version__, **versions},
        scene=scene_digest(experiment.task, experiment.robot),
        task_code=code_of(experiment.task),
        robot=describe_robot(experiment.robot),
        limits=experiment.limits,
        contended=case.contended,
        attempt=case.attempt,
        **found,
    )


def expected(experiment: Experiment, number: int = 1) -> Record:
    """The record of a repetition that has not begun: everything about it that is known here.

    Settings are those of the adapter's profile with the case's changes; versions those installed
    here or in the interpreter that the engine lives in. What only a worker can tell is absent.
    """
    case = experiment.case
    return record_of(experiment, number, settings=settings(case), versions=versions(case))


def settings(case: Case) -> dict[str, Any]:
    """The simulator's settings; empty for an adapter that is not registered under its name."""
    if address(case.simulator) != case.adapter:
        return {}  # its module may do anything when it is imported
    return settings_of(case.simulator, case.base, case.changes).to_wire()


def versions(case: Case) -> dict[str, str]:
    """The engine's version, where it is installed here or in the interpreter that it lives in."""
    if address(case.simulator) != case.adapter or case.spec:
        return {}
    info = adapter(case.simulator).info
    if case.python is None:
        here = {"python": platform.python_version()}
        with suppress(PackageNotFoundError):
            here[info.distribution] = version(info.distribution)
        return here
    other = outside(info)
    if other is not None and Path(case.python) == other.python:
        found = other.version()
        return {info.distribution: found} if found else {}
    return {}  # somebody's own interpreter


def describe_robot(robot: Robot | None) -> dict[str, str]:
    """Name of a robot and twelve digits of everything that it is; empty for a task's own robot."""
    if robot is None:
        return {}
    return {"name": robot.name, "digest": _robot_digest(robot)}


@robot_cache
def _robot_digest(robot: Robot) -> str:
    wire = with_content({"robot": robot.to_wire()}, robot)["robot"]
    meshes = sorted(wire[CONTENT].pop("meshes"))  # named by their content
    bounds = asdict(robot.limits) if robot.limits else None
    others = [*filter(None, [robot.swing, robot.stand and robot.stand.to_wire()])]
    data = json.dumps([wire, meshes, bounds, *others])
    return hashlib.sha256(data.encode()).hexdigest()[:12]


def scene_digest(task: Task, chosen: Robot | None = None) -> str:
    """Twelve digits of what the task builds for one seed without jitter; empty if it builds none.

    A robot's files count with their content, not their place; a scene's with what was read. A robot
    of the task's own, neither `chosen` by an option nor a built-in one as it is, counts with all
    that it is.
    """
    try:
        try:
            wire = _wire(task)
        except TypeError:  # a task with a list among its parameters
            wire = _wire.__wrapped__(task)
        wire = {key: value for key, value in wire.items() if key != "file"}
        if robot := wire.get("robot"):
            kept = {key: value for key, value in robot.items() if key != "packages"}
            told = {**kept, **{k: _content(robot[k]) for k in ("urdf", "srdf")}}
            wire = {**wire, "robot": told}
            own = getattr(task, ROBOT, None)
            if chosen is None and isinstance(own, Robot):
                as_it_is = known_robot(own.name) if own.name in BUILT_IN else None
                if describe_robot(own) != describe_robot(as_it_is):
                    wire["own"] = describe_robot(own)
        return data_digest(wire, 12)
    except Exception:  # a task may refuse this seed; then nothing is known
        return ""


@lru_cache(maxsize=16)
def _wire(task: Task) -> dict[str, Any]:
    return task.scene(0, Jitter(0.0, 0.0)).to_wire()


def _content(path: str) -> str:
    try:
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()
    except OSError:
        return ""


def file_stem(experiment: Experiment, number: int) -> str:
    """The name of a repetition's log and trace, without folder and ending; no other has it."""
    case, task = experiment.case, experiment.task
    return _stem(case.test, task.name, task.parameters(), number, case.attempt)


def file_stem_of(record: Record) -> str:
    """The same for a record, as its run named them."""
    task = {key: value for key, value in record.settings.items() if key.startswith("task.")}
    return _stem(record.test, record.task, task, record.repetition, record.attempt)


def _stem(test: str, task: str, of_task: Mapping[str, Any], number: int, attempt: int) -> str:
    told = text(plain(of_task))
    name = file_name(short(test), test, task, told)
    return f"{name}-{number}" if attempt == 1 else f"{name}-{number}-attempt-{attempt}"
