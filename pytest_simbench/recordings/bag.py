"""A trace as a rosbag2 folder (MCAP), for Foxglove, Lichtblick, PlotJuggler and `ros2 bag`.

    /clock                rosgraph_msgs/Clock           simulated time, with each sample
    /joint_states         sensor_msgs/JointState        positions and velocities
    /tf                   tf2_msgs/TFMessage            links in their parents, free bodies in world
    /tf_static            tf2_msgs/TFMessage            the root link and fixed bodies; latched
    /robot_description    std_msgs/String               the reduced URDF; latched
    /markers              visualization_msgs/MarkerArray  every shape, in its own frame; latched
    /rosout               rcl_interfaces/Log            where phases begin

Stamps are simulated time. The frame of a body is `bodies/NAME`. Meshes are lists of triangles:
paths to mesh files would not travel.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pytest_simbench.ground.text import for_terminal, in_one_line
from pytest_simbench.recordings.figure import relative
from pytest_simbench.recordings.trace import Trace
from pytest_simbench.scene import Body, FloatArray, Pose, Solid

if TYPE_CHECKING:
    from rosbags.rosbag2 import Writer

INSTALL = "recordings need rosbags: pip install 'pytest-simbench[ros]'"

WORLD = "world"
"""The frame in which everything stands."""

METAL = (0.9, 0.9, 0.92, 1.0)
"""Colour of the robot's links: red, green, blue, alpha."""


class BagsUnavailable(ImportError):
    """rosbags is not installed; the message says how to install it."""


def check_available() -> None:
    """Complain before anything runs.

    Raises:
        BagsUnavailable: rosbags is not installed.
    """
    from importlib.util import find_spec

    if find_spec("rosbags") is None:
        raise BagsUnavailable(INSTALL)


def write_bag(trace: Trace, folder: Path, told: dict[str, str] | None = None) -> None:
    """Write a trace as a bag of its own; one that was there is replaced.

    Args:
        folder: of the bag; the one above it is there, and no link.
        told: texts for the bag's metadata (`custom_data`), by name.

    Raises:
        BagsUnavailable: rosbags is not installed.
        OSError: it cannot be written.
    """
    check_available()
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.rosbag2.enums import CompressionFormat, CompressionMode

    part = Path(tempfile.mkdtemp(".part", ".", folder.parent))
    inner = part / folder.name  # rosbags names the file like its folder
    try:
        writer = Writer(inner, version=9, storage_plugin=StoragePlugin.MCAP)
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        for name, text in (told or {}).items():
            writer.set_custom_data(name, in_one_line(text))
        with writer:
            _Bag(writer, trace).write()
        if folder.exists():
            shutil.rmtree(folder)
        inner.rename(folder)
    finally:
        with suppress(OSError):
            shutil.rmtree(part)


class _Bag:
    """The topics of one bag."""

    def __init__(self, writer: Writer, trace: Trace) -> None:
        from pytest_simbench.recordings.messages import NANOSECONDS, Messages

        self._writer = writer
        self._trace = trace
        self._messages = Messages()
        self._times = np.rint(trace.time * NANOSECONDS).astype(np.int64).tolist()
        self._phases = [(max(0, round(t * NANOSECONDS)), name) for t, name in trace.phases]

    def write(self) -> None:
        """Write all messages, in the order of time."""
        start, figure, make = self._times[0], self._trace.figure, self._messages.make
        transforms, markers = self._static(start), list(self._markers(start))
        told = make("tf2_msgs/msg/TFMessage", transforms=transforms)
        self._topic("/tf_static", "tf2_msgs/msg/TFMessage", latched=True)(start, told)
        told = make("visualization_msgs/msg/MarkerArray", markers=markers)
        self._topic("/markers", "visualization_msgs/msg/MarkerArray", latched=True)(start, told)
        if figure is not None:
            told = make("std_msgs/msg/String", data=_lines(figure.urdf))
            self._topic("/robot_description", "std_msgs/msg/String", latched=True)(start, told)
        self._samples()

    def _samples(self) -> None:
        """What moves, sample by sample, and the phases in between."""
        clock = self._topic("/clock", "rosgraph_msgs/msg/Clock")
        tf = self._topic("/tf", "tf2_msgs/msg/TFMessage")
        joints = self._topic("/joint_states", "sensor_msgs/msg/JointState")
        log = self._topic("/rosout", "rcl_interfaces/msg/Log")
        messages, make, trace = self._messages, self._messages.make, self._trace
        names, frames = [in_one_line(name) for name in trace.joint_names], list(_moving(trace))
        none, waiting = np.zeros(0), list(self._phases)
        for k, now in enumerate(self._times):
            last = k == len(self._times) - 1
            while waiting and (last or waiting[0][0] <= now):  # each with its own stamp
                began, name = waiting.pop(0)
                log(began, messages.log(began, "phase", name))
            clock(now, make("rosgraph_msgs/msg/Clock", clock=messages.stamp(now)))
            if names:
                header, (position, velocity) = messages.header(now, WORLD), trace.joints[k]
                state = {"name": names, "position": position, "velocity": velocity, "effort": none}
                joints(now, make("sensor_msgs/msg/JointState", header=header, **state))
            found = [
                messages.transform(now, parent, child, poses[k]) for parent, child, poses in frames
            ]
            if found:
                tf(now, make("tf2_msgs/msg/TFMessage", transforms=found))

    def _static(self, start: int) -> list[Any]:
        """Where that is which never moves."""
        trace = self._trace
        poses = [(frame_of(box), box.pose) for box in trace.fixed]
        if trace.figure is not None:
            poses.insert(0, (trace.figure.root, Pose()))
        transform = self._messages.transform
        return [transform(start, WORLD, child, pose.as_array()) for child, pose in poses]

    def _markers(self, start: int) -> Iterator[Any]:
        """A marker for each shape, in the frame of its link or body; it moves with that frame."""
        figure, marker = self._trace.figure, self._messages.marker
        solids = [(box, solid) for box in self._trace.boxes for solid in box.solids()]
        for k, (box, solid) in enumerate(solids):
            yield marker(start, frame_of(box), "bodies", k, solid, box.colour)
        for k, part in enumerate(figure.parts if figure else ()):
            if figure is not None and part.mesh is not None:
                mesh: Any = (figure.meshes[part.mesh].vertices, figure.meshes[part.mesh].faces)
                solid = Solid("mesh", (1.0, 1.0, 1.0), part.pose, mesh)
            else:
                solid = Solid("box", part.size or (0.0, 0.0, 0.0), part.pose)
            yield marker(start, part.link, "robot", k, solid, METAL)

    def _topic(self, name: str, kind: str, latched: bool = False) -> Callable[[int, Any], None]:
        """Adds a topic; what writes a message of it at a time [ns]."""
        store = self._messages.store
        connection = self._writer.add_connection(
            name, kind, typestore=store, offered_qos_profiles=[_qos(latched)]
        )

        def write(now: int, message: Any) -> None:
            self._writer.write(connection, now, store.serialize_cdr(message, kind))

        return write


def frame_of(box: Body) -> str:
    """The frame of a body; no link's name has a slash."""
    return f"bodies/{in_one_line(box.name)}"


def _moving(trace: Trace) -> Iterator[tuple[str, str, FloatArray]]:
    """Frames that move: parent, child, and poses (n, 7) in the parent."""
    if trace.figure is not None:
        names = list(trace.joint_names)
        for hinge in trace.figure.hinges:
            poses = relative(hinge, trace.joints[:, 0, names.index(hinge.name)])
            yield hinge.parent, hinge.child, poses
    for k, box in enumerate(trace.free):
        yield WORLD, frame_of(box), trace.bodies[:, k, :7]


def _lines(text: str) -> str:
    """A text of any length and many lines, all of them printable."""
    return for_terminal(text, longest=10 * len(text) + 1)  # `\\U0010ffff` for one character


def _qos(latched: bool) -> Any:
    """As ROS publishes such topics: reliable; the last message of a latched one reaches those who
    come later."""
    from rosbags.interfaces import (
        Qos,
        QosDurability,
        QosHistory,
        QosLiveliness,
        QosReliability,
        QosTime,
    )

    never = QosTime(2147483647, 4294967295)
    return Qos(
        QosHistory.KEEP_LAST,
        1 if latched else 100,
        QosReliability.RELIABLE,
        QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
        never,
        never,
        QosLiveliness.AUTOMATIC,
        never,
        False,
    )
