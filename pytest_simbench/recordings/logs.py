"""Logs of joints and bodies, for a scene to follow or to be fitted to (`tasks.Replaying`,
`tasks.Fitting`): `.npz`, `.csv`, `.mcap`.

    time              [s], (n,)
    NAME              positions of that joint [rad or m]; NAME/velocity and NAME/effort besides
    NAME/command      what its drive was told, where that is known; else it is told NAME
    NAME/pose         of that free body, (n, 7), as in a file of starts; not in `.csv`

An `.npz` file may have `position`, `velocity` and `effort` (n, joints) instead, in the order of the
scene. Both count as the scene's file does. Of an `.mcap` file `/joint_states` and `/tf` are read,
as `recordings.bag` writes them.
"""

from __future__ import annotations

import csv
import hashlib
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from pytest_simbench.description.urdf import PreparedRobot
from pytest_simbench.ground.errors import DescriptionError
from pytest_simbench.ground.files import FileError, read_arrays, read_file
from pytest_simbench.recordings.bag import BagsUnavailable, check_available, frame_of
from pytest_simbench.records.metrics import RESOLUTIONS
from pytest_simbench.scene import FloatArray, Pose, Robot, Scene, Start, Trajectory
from pytest_simbench.scene.checks import UNIT_TOLERANCE
from pytest_simbench.tasks.on_scene import place
from pytest_simbench.tasks.replaying import Log

LARGEST = 64 * 2**20
"""Of a log [bytes]."""

SHORTEST, LONGEST = 0.1, 600.0
"""A log [s]."""

FINEST = 1e-3
"""Steps of a log are kept down to this [s]."""

FARTHEST = 1e9
"""Any number of a log but its times, which may count from 1970."""

MOST = 1_000_000
"""Messages of a recording."""

Columns = dict[str, np.ndarray]


def read_log(path: str | Path, scene: Scene) -> Log:
    """The log of a file, for the joints of a scene. It begins at its first row, whatever the time.

    Raises:
        DescriptionError: no such file, or something in it that cannot be; one sentence.
    """
    path = Path(path)
    read = READERS.get(path.suffix.lower())
    if read is None:
        raise DescriptionError(f"{path} is no log; give {', '.join(READERS)}")
    if scene.robot is None and not scene.free_bodies:
        raise DescriptionError(
            f"{path}: scene {scene.name!r} has no joints and no free bodies, so no log is of it"
        )
    try:
        return _log(read(path, scene), scene, scene.robot)
    except (FileError, BagsUnavailable) as error:
        raise DescriptionError(str(error)) from None
    except ValueError as error:
        raise DescriptionError(f"the log {path} {error}") from None


def _log(columns: Columns, scene: Scene, robot: Robot | None) -> Log:
    """With a regular time, in steps of about the median of the log's.

    Raises:
        ValueError: columns that do not fit the scene.
    """
    joints, parts = robot.joint_names if robot else (), ("", "/velocity", "/effort", "/command")
    places = {name + part: (p, k) for p, part in enumerate(parts) for k, name in enumerate(joints)}
    bodies = {f"{body.name}/pose": body.name for body in scene.free_bodies}
    known = ", ".join((*joints, *bodies))
    time = _numbers("time", columns.pop("time", np.zeros(0)))
    if time.ndim > 1 or len(time) < 2:
        raise ValueError("has no column 'time' of two rows or more [s]")
    steps, lasts = np.diff(time), float(time[-1] - time[0])
    if (steps <= 0).any():
        row = int(np.argmax(steps <= 0)) + 1
        raise ValueError(f"goes from {time[row - 1]:.12g} s to {time[row]:.12g} s in row {row}")
    if not SHORTEST <= lasts <= LONGEST:
        raise ValueError(f"lasts {lasts:g} s; {SHORTEST:g} to {LONGEST:g} s are read")
    grid = np.linspace(0.0, lasts, max(1, round(lasts / max(np.median(steps), FINEST))) + 1)
    rows, digest = np.zeros((4, len(grid), len(joints))), hashlib.sha256(time.tobytes())
    rows[0] = robot.column("initial_position") if robot else 0.0
    poses: dict[str, FloatArray] = {}
    seen = {"time": time - time[0]}
    for name, raw in sorted(columns.items()):
        if name not in places and name not in bodies:
            raise ValueError(
                f"holds {name!r:.80}, which scene {scene.name!r} has not; it has {known}"
            )
        array = _numbers(name, raw)
        wanted = (len(time), 7) if name in bodies else (len(time),)
        if array.shape != wanted:
            raise ValueError(f"holds {name!r:.80} in the shape {array.shape} instead of {wanted}")
        if np.abs(array).max() > FARTHEST:
            raise ValueError(f"has a number of {name!r:.80} beyond {FARTHEST:g} (in SI units)")
        digest.update(name.encode() + array.tobytes())
        if name in places:
            part, k = places[name]
            rows[part, :, k] = np.interp(grid, seen["time"], array)
            seen |= {} if part else {name: array}
            continue
        wrong = np.abs(np.linalg.norm(array[:, 3:], axis=1) - 1) > UNIT_TOLERANCE
        if wrong.any():
            row = int(np.argmax(wrong))
            raise ValueError(f"has a quaternion of no unit length in {name!r:.80}, row {row}")
        poses[bodies[name]] = array
    named = [name for name in joints if name in columns]
    if not named and not poses:
        raise ValueError(f"has positions of no joint and no body; the scene has {known}")
    ends = PreparedRobot(robot).limits if robot else {}
    first = [float(np.clip(at, *ends[name])) for name, at in zip(joints, rows[0, 0], strict=True)]
    told = [name for name in joints if f"{name}/command" in columns]
    for k in map(joints.index, told):
        rows[0, :, k] = rows[3, :, k]
    start, end = (tuple(Pose.from_array(array[k]) for array in poses.values()) for k in (0, -1))
    return Log(
        Trajectory(float(grid[1]), *rows[:3]), named,
        Start(tuple(poses), start, tuple(first)), Start(tuple(poses), end),
        digest.hexdigest()[:16],
        seen | {f"{name}/pose": array for name, array in poses.items()}, told,
    )  # fmt: skip


def beyond(log: Log, scene: Scene) -> list[str]:
    """Of each joint that the log has outside of its range in the scene: how far it goes, a sentence
    each. The scene starts such a joint at the end of its range, and its stops hold it there."""
    ends, found = PreparedRobot(scene.robot).limits if scene.robot else {}, []
    for name in log.joints:
        (low, high), least, most = ends[name], log.seen[name].min(), log.seen[name].max()
        if least < low - RESOLUTIONS["rad"] or most > high + RESOLUTIONS["rad"]:
            found.append(
                f"{name} goes from {least:.4g} to {most:.4g} rad or m, and in scene {scene.name!r} "
                f"it stops at {low:.4g} and {high:.4g}"
            )
    return found


def _numbers(name: str, array: np.ndarray) -> FloatArray:
    if array.dtype.kind not in "fiu" or not array.ndim:
        raise ValueError(f"holds {name!r:.80}, which is no column of numbers")
    finite = np.isfinite(array).all(axis=tuple(range(1, array.ndim)))
    if not finite.all():
        raise ValueError(f"has no finite number of {name!r:.80} in row {int(np.argmin(finite))}")
    return np.asarray(array, dtype=float)


def _npz(path: Path, scene: Scene) -> Columns:
    found, names = read_arrays(path, LARGEST), scene.robot.joint_names if scene.robot else ()
    for whole, part in (("position", ""), ("velocity", "/velocity"), ("effort", "/effort")):
        if whole in found and found[whole].ndim == 2:
            array = found.pop(whole)
            if array.shape[1] != len(names):
                told = f"of {array.shape[1]} joints, and the scene has {len(names)}"
                raise ValueError(f"holds {whole!r} {told}: {', '.join(names)}")
            found |= {f"{name}{part}": array[:, k] for k, name in enumerate(names)}
    return _from_file(found, scene)


def _csv(path: Path, scene: Scene) -> Columns:
    text = read_file(path, LARGEST, "the log").decode("utf-8-sig", "replace")
    rows, found = csv.reader(io.StringIO(text, newline="")), []
    try:
        names = [name.strip() for name in next(rows, [])]
        if len(set(names)) < len(names):
            raise ValueError("two columns of one name")
        for row in filter(None, rows):
            if len(row) != len(names):
                raise ValueError(f"{len(row)} values for {len(names)} columns")
            found.append([float(value) for value in row])
    except (ValueError, csv.Error) as error:
        raise ValueError(f"cannot be read, line {rows.line_num}: {error}") from None
    columns = np.array(found, dtype=float).reshape(len(found), len(names)).T
    return _from_file(dict(zip(names, columns, strict=True)), scene)


def _from_file(columns: Columns, scene: Scene) -> Columns:
    """What counts as the scene's file does, counted as the scene does."""
    joints = scene.robot.joints if scene.robot else ()
    moved = {j.name + part: np.array(-j.file_zero) for j in joints for part in ("", "/command")}
    moved |= {f"{body.name}/pose": np.eye(7)[2] * scene.file_lift for body in scene.free_bodies}
    for name, array in columns.items():
        if name in moved and array.shape[1:] == moved[name].shape and array.dtype.kind in "fiu":
            columns[name] = array + moved[name]
    return columns


def _mcap(path: Path, scene: Scene) -> Columns:
    check_available()
    read_file(path, LARGEST, "the log")  # a file, and not too large
    try:
        return _recorded(path, scene)
    except Exception as error:  # rosbags, lz4 and zstd have many for what is none
        raise ValueError(f"is no recording: {error}") from None


def _recorded(path: Path, scene: Scene) -> Columns:
    from rosbags.rosbag2 import Reader

    from pytest_simbench.recordings.messages import NANOSECONDS, Messages

    store, frames = Messages().store, {frame_of(body): body for body in scene.free_bodies}
    found: dict[str, list[Any]] = {"time": []}
    stamps: dict[int, None] = {}  # of what moves a body: a scene without joints tells no other
    with Reader(path) as reader:
        if reader.message_count > MOST:
            raise ValueError(f"it holds more than {MOST} messages")
        topics = [c for c in reader.connections if c.topic in ("/joint_states", "/tf")]
        for connection, stamp, data in reader.messages(topics):
            message: Any = store.deserialize_cdr(data, connection.msgtype)
            if connection.topic == "/joint_states":
                found["time"].append(stamp / NANOSECONDS)
                for part, values in (("", message.position), ("/velocity", message.velocity)):
                    for name, value in zip(message.name, values, strict=bool(len(values))):
                        found.setdefault(name + part, []).append(value)
                continue
            for told in message.transforms:
                if body := frames.get(told.child_frame_id):
                    stamps[stamp] = None
                    t, q = told.transform.translation, told.transform.rotation
                    pose = Pose.from_array([t.x, t.y, t.z, q.w, q.x, q.y, q.z])
                    row = place(body.moved_to(pose)).as_array()
                    found.setdefault(f"{body.name}/pose", []).append(row)
    found["time"] = found["time"] or [stamp / NANOSECONDS for stamp in stamps]
    return {name: np.array(rows) for name, rows in found.items()}


READERS: dict[str, Callable[[Path, Scene], Columns]] = {".npz": _npz, ".csv": _csv, ".mcap": _mcap}
"""By the ending of a file."""
