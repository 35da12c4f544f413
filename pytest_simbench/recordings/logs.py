"""Logs of a robot's joints, for a scene to follow (`tasks.Replaying`): `.npz`, `.csv`, `.mcap`.

    time              [s], (n,)
    NAME              positions of that joint [rad or m]; NAME/velocity and NAME/effort besides
    NAME/pose         of that free body, (n, 7), as in a file of starts; not in `.csv`

An `.npz` file may have `position`, `velocity` and `effort` (n, joints) instead, in the order of the
scene. Of an `.mcap` file `/joint_states` and `/tf` are read, as `recordings.bag` writes them.
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
from pytest_simbench.recordings.bag import check_available, frame_of
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

MOST = 1_000_000
"""Messages of a recording."""

Columns = dict[str, np.ndarray]


def read_log(path: str | Path, scene: Scene) -> Log:
    """The log of a file, for the joints of a scene. It begins at its first row, whatever the time.

    Raises:
        DescriptionError: no such file, or something in it that cannot be; one sentence.
    """
    path = Path(path)
    if scene.robot is None or not scene.robot.joints:
        raise DescriptionError(f"{path}: scene {scene.name!r} has no joints, so none follow a log")
    read = READERS.get(path.suffix.lower())
    if read is None:
        raise DescriptionError(f"{path} is no log; give {', '.join(READERS)}")
    try:
        columns = read(path, scene)
    except FileError as error:
        raise DescriptionError(str(error)) from None
    checked = _Checked(path, columns, scene)
    return checked.log(scene.robot)


class _Checked:
    """Columns of a log that fit its scene.

    Raises:
        DescriptionError: they do not.
    """

    def __init__(self, path: Path, columns: Columns, scene: Scene) -> None:
        self.path, self.scene = path, scene
        joints = scene.robot.joint_names if scene.robot else ()
        parts = ("", "/velocity", "/effort")
        self.places = {name + part: (p, k) for p, part in enumerate(parts)
                       for k, name in enumerate(joints)}  # fmt: skip
        self.bodies = {f"{body.name}/pose": body.name for body in scene.free_bodies}
        self.columns = {name: self._numbers(name, array) for name, array in columns.items()}
        self.time = self.columns.pop("time", np.zeros(0))
        if len(self.time) < 2:
            self._refuse("has no column 'time' of two rows or more [s]")
        steps = np.diff(self.time)
        if (steps <= 0).any():
            row = int(np.argmax(steps <= 0)) + 1
            self._refuse(f"goes from {self.time[row - 1]:g} s to {self.time[row]:g} s in row {row}")
        if not SHORTEST <= np.ptp(self.time) <= LONGEST:
            self._refuse(f"lasts {np.ptp(self.time):g} s; {SHORTEST:g} to {LONGEST:g} s are read")
        for name, array in self.columns.items():
            self._check(name, array, joints)
        self.joints = [name for name in joints if name in self.columns]
        if not self.joints:
            self._refuse(f"has positions of no joint; the scene has {', '.join(joints)}")

    def _refuse(self, why: str) -> None:
        raise DescriptionError(f"the log {self.path} {why}")

    def _numbers(self, name: str, array: np.ndarray) -> FloatArray:
        if array.dtype.kind not in "fiu" or not array.ndim:
            self._refuse(f"holds {name!r:.80}, which is no column of numbers")
        finite = np.isfinite(array).reshape(len(array), -1).all(axis=1)
        if not finite.all():
            self._refuse(f"has no finite number of {name!r:.80} in row {int(np.argmin(finite))}")
        return np.asarray(array, dtype=float)

    def _check(self, name: str, array: FloatArray, joints: tuple[str, ...]) -> None:
        if name not in self.places and name not in self.bodies:
            bodies = f" and the poses {', '.join(self.bodies)}" if self.bodies else ""
            self._refuse(
                f"holds {name!r:.80}, which is nothing of scene {self.scene.name!r}; it has the "
                f"joints {', '.join(joints)}{bodies}"
            )
        wanted = (len(self.time), 7) if name in self.bodies else (len(self.time),)
        if array.shape != wanted:
            self._refuse(f"holds {name!r:.80} in the shape {array.shape} instead of {wanted}")
        if name in self.bodies:
            wrong = np.abs(np.linalg.norm(array[:, 3:], axis=1) - 1) > UNIT_TOLERANCE
            if wrong.any():
                row = int(np.argmax(wrong))
                self._refuse(f"has a quaternion of no unit length in {name!r:.80}, row {row}")

    def log(self, robot: Robot) -> Log:
        """With a regular time, in steps of about the median of the log's."""
        time, count = self.time - self.time[0], len(robot.joints)
        step = max(float(np.median(np.diff(time))), FINEST)
        grid = np.linspace(0.0, time[-1], max(1, round(time[-1] / step)) + 1)
        rows = np.zeros((3, len(grid), count))
        rows[0] = robot.column("initial_position")
        limits = PreparedRobot(robot).limits
        digest = hashlib.sha256(time.tobytes())
        for name, array in sorted(self.columns.items()):
            digest.update(name.encode() + array.tobytes())
            if name in self.places:
                part, k = self.places[name]
                rows[part, :, k] = np.interp(grid, time, array)
        pairs = zip(robot.joint_names, rows[0, 0].tolist(), strict=True)
        positions = [float(np.clip(at, *limits[name])) for name, at in pairs]
        return Log(
            Trajectory(float(grid[1]), *rows), self.joints, self._bodies(0, positions),
            self._bodies(-1), digest.hexdigest()[:16],
        )  # fmt: skip

    def _bodies(self, row: int, positions: list[float] | None = None) -> Start:
        logged = {own: self.columns[n] for n, own in self.bodies.items() if n in self.columns}
        poses = tuple(Pose.from_array(array[row]) for array in logged.values())
        return Start(tuple(logged), poses, tuple(positions or ()))


def _npz(path: Path, scene: Scene) -> Columns:
    found, names = read_arrays(path, LARGEST), scene.robot.joint_names if scene.robot else ()
    for whole, part in (("position", ""), ("velocity", "/velocity"), ("effort", "/effort")):
        if whole in found and found[whole].ndim == 2:
            array = found.pop(whole)
            if array.shape[1] != len(names):
                raise DescriptionError(
                    f"the log {path} holds {whole!r} of {array.shape[1]} joints, and the scene has "
                    f"{len(names)}: {', '.join(names)}"
                )
            found |= {f"{name}{part}": array[:, k] for k, name in enumerate(names)}
    for body in scene.free_bodies:
        array = found.get(f"{body.name}/pose", np.zeros(0))
        if array.ndim == 2 and array.shape[1] == 7 and array.dtype.kind in "fiu":
            found[f"{body.name}/pose"] = array + np.eye(7)[2] * scene.file_lift
    return found


def _csv(path: Path, scene: Scene) -> Columns:
    text = read_file(path, LARGEST, "the log").decode("utf-8-sig", "replace")
    rows = csv.reader(io.StringIO(text, newline=""))
    found = []
    try:
        names = [name.strip() for name in next(rows, [])]
        if len(set(names)) < len(names):
            raise DescriptionError(f"the log {path} has two columns of one name in line 1")
        for row in filter(None, rows):
            if len(row) != len(names):
                told = f"{len(row)} values for {len(names)} columns"
                raise DescriptionError(f"the log {path}, line {rows.line_num} has {told}")
            found.append([float(value) for value in row])
    except (ValueError, csv.Error) as error:
        raise DescriptionError(f"the log {path}, line {rows.line_num}: {error}") from None
    return dict(
        zip(names, np.array(found, dtype=float).reshape(len(found), len(names)).T, strict=True)
    )


def _mcap(path: Path, scene: Scene) -> Columns:
    try:
        check_available()
    except ImportError as error:
        raise DescriptionError(f"{path}: {error}") from None
    read_file(path, LARGEST, "the log")  # a file, and not too large
    try:
        return _recorded(path, scene)
    except DescriptionError:
        raise
    except Exception as error:  # rosbags, lz4 and zstd have many for what is none
        raise DescriptionError(f"the log {path} is no recording: {error}") from None


def _recorded(path: Path, scene: Scene) -> Columns:
    from rosbags.rosbag2 import Reader

    from pytest_simbench.recordings.messages import NANOSECONDS, Messages

    store, frames = Messages().store, {frame_of(body): body for body in scene.free_bodies}
    times: list[float] = []
    rows: dict[str, list[list[float]]] = {}
    with Reader(path) as reader:
        if reader.message_count > MOST:
            raise DescriptionError(f"the log {path} holds more than {MOST} messages")
        topics = [c for c in reader.connections if c.topic in ("/joint_states", "/tf")]
        for connection, stamp, data in reader.messages(topics):
            message: Any = store.deserialize_cdr(data, connection.msgtype)
            if connection.topic == "/joint_states":
                times.append(stamp / NANOSECONDS)
                names = message.name
                own = {"": message.position, "/velocity": message.velocity}
                for part, values in own.items():
                    for name, value in zip(names, values, strict=bool(len(values))):
                        rows.setdefault(name + part, []).append([value])
                continue
            for told in message.transforms:
                body = frames.get(told.child_frame_id)
                if body is not None:
                    t, q = told.transform.translation, told.transform.rotation
                    pose = body.moved_to(Pose.from_array([t.x, t.y, t.z, q.w, q.x, q.y, q.z]))
                    rows.setdefault(f"{body.name}/pose", []).append(place(pose).as_array().tolist())
    columns = {name: np.array(row) for name, row in rows.items()}
    flat = {name: row if name.endswith("/pose") else row[:, 0] for name, row in columns.items()}
    return {"time": np.array(times), **flat}


READERS: dict[str, Callable[[Path, Scene], Columns]] = {".npz": _npz, ".csv": _csv, ".mcap": _mcap}
"""By the ending of a file."""
