"""Episodes as files: scene and commands of one that failed, and the line that replays it.

Such a file is made to be passed on, so it says what to simulate and never how to start anything:
interpreter, adapter, environment and the files of the robot are this machine's own.
"""

from __future__ import annotations

import json
import os
import shlex
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pytest_simbench.client.environments import interpreter, missing
from pytest_simbench.client.tape import ARRAYS, Operation
from pytest_simbench.experiment.case import Case
from pytest_simbench.ground.errors import SimulatorError
from pytest_simbench.ground.files import FileError, read_file, read_json
from pytest_simbench.ground.names import file_name
from pytest_simbench.ground.text import in_one_line
from pytest_simbench.motion.registry import BUILT_IN as ROBOTS
from pytest_simbench.records.paths import write_whole
from pytest_simbench.scene import Scene
from pytest_simbench.simulator.registry import adapter, settings_of

FOLDER = "examples"
SCHEMA = 2
"""1 named adapter and interpreter as well; they are not looked at."""

LARGEST = 64 * 2**20
"""Of a file [bytes]; the commands of a whole stacking have 5 MB."""

MOST_BODIES = 300
LONGEST_MOTION, LONGEST_WAIT = 600.0, 86_400.0
"""Of one operation [s]."""

ROBOT_FILES = ("urdf", "srdf", "packages")
"""What a file does not hold of a robot that comes with the package."""


class ExampleError(ValueError):
    """A file that holds no episode, or none for this machine; the message names it."""


@dataclass(frozen=True)
class Example:
    """An episode that was read.

    Attributes:
        case: how it is run on this machine.
        versions: of the packages it was made with, by name; for a comparison.
    """

    case: Case
    scene: Scene
    tape: Sequence[Operation]
    versions: Mapping[str, str]


def write_example(
    case: Case,
    name: str,
    scene: Scene,
    tape: Sequence[Operation],
    versions: Mapping[str, str] | None = None,
) -> Path:
    """Write an episode to the run folder; one of the same test and name is replaced.

    Under Hypothesis the last failing example is the smallest, so that is what stays.

    Args:
        name: the readable part of the file's name.

    Raises:
        OSError: the folder cannot be written to.
    """
    test = os.environ.get("PYTEST_CURRENT_TEST", "").rpartition(" ")[0]
    file = f"{FOLDER}/{file_name(name, test, case.test)}.json"
    world = scene.to_wire()
    if scene.robot is not None and scene.robot.name in ROBOTS:
        world["robot"] = {k: v for k, v in world["robot"].items() if k not in ROBOT_FILES}
    kept = {key: getattr(case, key) for key in ("test", "simulator", "mode")}
    kept["profile"] = case.base
    example = {
        "schema": SCHEMA,
        "case": {**kept, "changes": dict(case.changes), "versions": dict(versions or {})},
        "scene": world,
        "tape": [operation.to_wire() for operation in tape],
    }
    write_whole(case.folder, file, f"{json.dumps(example)}\n".encode())
    return case.folder / file


def read_example(
    path: Path,
    folder: Path,
    *,
    mode: str | None = None,
    python: str | None = None,
    spec: str | None = None,
    trust_robot: bool = False,
) -> Example:
    """An episode from its file, with a run folder of its own. Nothing is started.

    Args:
        folder: for the replay's logs.
        mode: instead of the file's.
        python, spec: interpreter or execnet specification of the worker; default: this machine's.
        trust_robot: whether to use the description files that the file names, for a robot that
            is not known here.

    Raises:
        ExampleError: no such file, something else in it, or something that this machine lacks.
    """
    try:
        data = read_json(read_file(path, LARGEST, "the episode"))
    except FileError as error:
        raise ExampleError(str(error)) from None
    except ValueError as error:
        raise ExampleError(f"{path} holds no episode of pytest-simbench: {error}") from None
    try:
        _check(isinstance(data, dict), "it is no object")
        schema = data.get("schema")
        _check(schema in range(1, SCHEMA + 1), f"schema {schema!r}, this reads up to {SCHEMA}")
        told = _known(data, "case", dict)
        scene = _scene(_known(data, "scene", dict), trust_robot)
        joints = 0 if scene.robot is None else len(scene.robot.joints)
        tape = [_operation(item, joints) for item in _known(data, "tape", list)]
        case = _case(told, folder, mode, python, spec)
        versions = {str(k): str(v) for k, v in (told.get("versions") or {}).items()}
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError) as error:
        reason = error.args[0] if isinstance(error, ValueError) else repr(error)
        raise ExampleError(
            in_one_line(f"{path} holds no episode of pytest-simbench: {reason}")
        ) from None
    except SimulatorError as error:
        raise ExampleError(in_one_line(f"{path}: {error}")) from None
    return Example(case, scene, tape, versions)


def _check(fine: bool, otherwise: str) -> None:
    if not fine:
        raise ValueError(otherwise)


def _known(data: Mapping[str, Any], key: str, kind: type) -> Any:
    _check(key in data, f"it has no {key!r}")
    _check(isinstance(data[key], kind), f"its {key!r} is no {kind.__name__}")
    return data[key]


def _case(
    told: Mapping[str, Any], folder: Path, mode: str | None, python: str | None, spec: str | None
) -> Case:
    """How this machine runs what a file tells.

    Raises:
        SimulatorError: the simulator, its profile or a setting is not known here, or not here.
        ValueError: something that is no case.
    """
    name, given, test = (_known(told, key, str) for key in ("simulator", "profile", "test"))
    mode = mode or _known(told, "mode", str)
    changes = _known(told, "changes", dict)
    cls = adapter(name)
    absent = None if python or spec else missing(cls.info)
    _check(mode in cls.info.modes, f"{name} has no mode {mode!r}: {', '.join(cls.info.modes)}")
    if absent:
        raise SimulatorError(absent)
    settings_of(name, given, changes)  # complains
    return Case.of(
        name,
        python=python,
        test=test,
        mode=mode,
        profile=given,
        folder=folder,
        changes=changes,
        spec=spec,
    )


def _scene(told: Mapping[str, Any], trust_robot: bool) -> Scene:
    _check(len(_known(told, "bodies", list)) <= MOST_BODIES, f"more than {MOST_BODIES} bodies")
    robot = told.get("robot")
    if isinstance(robot, dict):
        name = _known(robot, "name", str)
        if name in ROBOTS:
            own = ROBOTS[name]().to_wire()
            robot = {**robot, **{key: own[key] for key in ROBOT_FILES}}
        elif not trust_robot:
            raise ValueError(
                f"robot {name!r} is not known here (known: {', '.join(ROBOTS)}), and the files "
                "that describe it are not read at a file's word; give --trust-robot if you know "
                "where the file comes from"
            )
    return Scene.from_wire({**told, "robot": robot})


def _operation(told: Any, joints: int) -> Operation:
    """One operation of the tape, for a robot with so many joints."""
    _check(isinstance(told, dict), "an operation is no object")
    kind, arguments = _known(told, "kind", str), _known(told, "arguments", dict)
    phase = _known(told, "phase", str)
    wanted = {"wait": {"duration"}, "follow": {"tick", *ARRAYS}}.get(kind)
    _check(wanted is not None, f"an operation is {kind!r}, neither 'follow' nor 'wait'")
    fits = set(arguments) - {"striking"} == wanted and arguments.get("striking", True) is True
    _check(fits, f"an operation {kind!r} has {sorted(arguments)}")
    length, longest = ("duration", LONGEST_WAIT) if kind == "wait" else ("tick", LONGEST_MOTION)
    number = arguments[length]
    _check(
        isinstance(number, int | float) and not isinstance(number, bool) and 0 < number <= longest,
        f"an operation {kind!r} has the {length} {number!r}; it takes up to {longest:g} s",
    )
    for name in ARRAYS if kind == "follow" else ():
        _check_rows(name, arguments[name], joints)
    operation = Operation.from_wire(
        {"kind": kind, "arguments": arguments, "phase": in_one_line(phase)}
    )
    if kind == "follow":
        lengths = {len(operation.arguments[name]) for name in ARRAYS}
        _check(len(lengths) == 1, "the arrays of a motion have several lengths")
        _check(operation.duration <= longest, f"a motion lasts longer than {longest:g} s")
    return operation


def _check_rows(name: str, value: Any, joints: int) -> None:
    """An array of a motion, (n, joints); JSON holds finite numbers only."""
    try:
        rows = np.array(value)
    except ValueError:  # rows of several lengths
        rows = np.array(None)
    _check(
        rows.ndim == 2 and rows.dtype.kind in "fi" and rows.shape[1] == joints,
        f"the {name} of a motion is no array of {joints} joints",
    )


def replay_command(path: Path, case: Case, scene: Scene) -> str:
    """What to type to see the episode in `path` again, as it was run here."""
    with suppress(ValueError):
        path = path.absolute().relative_to(Path.cwd())
    words, own = ["simbench", "replay", str(path)], None
    with suppress(SimulatorError):
        own = interpreter(adapter(case.simulator).info)  # what a replay takes by itself
    if case.spec:
        words.append(f"--spec={case.spec}")
    elif case.python and case.python != own:
        words.append(f"--python={case.python}")
    if scene.robot is not None and scene.robot.name not in ROBOTS:
        words.append("--trust-robot")
    return shlex.join(words)
