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
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pytest_simbench.recordings.figure import relative
from pytest_simbench.recordings.trace import Trace
from pytest_simbench.records.text import in_one_line
from pytest_simbench.scene import Box, FloatArray, Pose

if TYPE_CHECKING:
    from rosbags.rosbag2 import Writer

INSTALL = "recordings need rosbags: pip install 'pytest-simbench[ros]'"

WORLD = "world"
"""The frame in which everything stands."""

METAL = (0.9, 0.9, 0.92, 1.0)
"""Colour of the robot's links: red, green, blue, alpha."""

ONE = (1.0, 1.0, 1.0)
"""Scale of a mesh."""

NANOSECONDS = 10**9

INFO = 20
"""Level of a message about what is normal (rcl_interfaces/msg/Log)."""


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
        trace: of a repetition.
        folder: of the bag.
        told: texts for the bag's metadata (`custom_data`), by name.

    Raises:
        BagsUnavailable: rosbags is not installed.
        OSError: it cannot be written.
    """
    check_available()
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.rosbag2.enums import CompressionFormat, CompressionMode

    part = folder.with_name(f".{folder.name}.part")
    shutil.rmtree(part, ignore_errors=True)
    inner = part / folder.name  # rosbags names the file like its folder
    try:
        writer = Writer(inner, version=9, storage_plugin=StoragePlugin.MCAP)
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        for name, text in (told or {}).items():
            writer.set_custom_data(name, in_one_line(text))
        with writer:
            _Bag(writer).write(trace)
        if folder.exists():
            shutil.rmtree(folder)
        inner.rename(folder)
    finally:
        with suppress(OSError):
            shutil.rmtree(part)


class _Bag:
    """The messages of one bag."""

    def __init__(self, writer: Writer) -> None:
        from rosbags.typesys import Stores, get_typestore

        self._writer = writer
        self._store = get_typestore(Stores.ROS2_JAZZY)

    def write(self, trace: Trace) -> None:
        """Write all topics, in the order of time."""
        nanoseconds = np.rint(trace.time * NANOSECONDS).astype(np.int64)
        start = int(nanoseconds[0])
        latched = [
            ("/tf_static", "tf2_msgs/msg/TFMessage", self._static(trace, start)),
            ("/markers", "visualization_msgs/msg/MarkerArray", self._markers(trace, start)),
        ]
        if trace.figure is not None:
            text = self._message("std_msgs/msg/String", data=trace.figure.urdf)
            latched.append(("/robot_description", "std_msgs/msg/String", text))
        for topic, kind, message in latched:
            self._topic(topic, kind, latched=True)(start, message)
        phases = iter(trace.phases)
        self._samples(trace, nanoseconds, self._log(phases))

    def _samples(
        self, trace: Trace, nanoseconds: np.ndarray, log: Callable[[int, bool], None]
    ) -> None:
        clock = self._topic("/clock", "rosgraph_msgs/msg/Clock")
        tf = self._topic("/tf", "tf2_msgs/msg/TFMessage")
        joints = self._topic("/joint_states", "sensor_msgs/msg/JointState")
        names = [in_one_line(name) for name in trace.joint_names]
        frames = list(_moving(trace))
        transform = self._store.types["geometry_msgs/msg/TransformStamped"]
        none = np.zeros(0)
        for k, now in enumerate(map(int, nanoseconds)):
            stamp = self._stamp(now)
            header = self._message("std_msgs/msg/Header", stamp=stamp, frame_id=WORLD)
            log(now, k == len(nanoseconds) - 1)
            clock(now, self._message("rosgraph_msgs/msg/Clock", clock=stamp))
            if names:
                positions, velocities = trace.joints[k]
                state = {"name": names, "position": positions, "velocity": velocities}
                kind = "sensor_msgs/msg/JointState"
                joints(now, self._message(kind, header=header, effort=none, **state))
            found = [
                transform(
                    header=self._message("std_msgs/msg/Header", stamp=stamp, frame_id=parent),
                    child_frame_id=child,
                    transform=self._transform(poses[k]),
                )
                for parent, child, poses in frames
            ]
            if found:
                tf(now, self._message("tf2_msgs/msg/TFMessage", transforms=found))

    def _log(self, phases: Iterator[tuple[float, str]]) -> Callable[[int, bool], None]:
        """Writes the phases that have begun by a time, each with its own stamp."""
        write = self._topic("/rosout", "rcl_interfaces/msg/Log")
        waiting = list(phases)

        def until(now: int, last: bool) -> None:
            while waiting and (last or waiting[0][0] * NANOSECONDS <= now):
                began, name = waiting.pop(0)
                at = max(0, round(began * NANOSECONDS))
                message = self._message(
                    "rcl_interfaces/msg/Log",
                    stamp=self._stamp(at),
                    level=INFO,
                    name="phase",
                    msg=in_one_line(name),
                    file="",
                    function="",
                    line=0,
                )
                write(at, message)

        return until

    def _static(self, trace: Trace, start: int) -> Any:
        poses = [(frame_of(box), box.pose) for box in trace.fixed]
        if trace.figure is not None:
            poses.insert(0, (in_one_line(trace.figure.root), Pose()))
        stamp = self._stamp(start)
        found = [
            self._message(
                "geometry_msgs/msg/TransformStamped",
                header=self._message("std_msgs/msg/Header", stamp=stamp, frame_id=WORLD),
                child_frame_id=child,
                transform=self._transform(pose.as_array()),
            )
            for child, pose in poses
        ]
        return self._message("tf2_msgs/msg/TFMessage", transforms=found)

    def _markers(self, trace: Trace, start: int) -> Any:
        """A marker for each shape, in the frame of its link or body; it moves with that frame."""
        marker: Any = self._store.types["visualization_msgs/msg/Marker"]
        found = [
            self._marker(
                start, frame_of(box), "bodies", k, marker.CUBE, Pose(), box.size, box.colour
            )
            for k, box in enumerate(trace.boxes)
        ]
        for k, part in enumerate(trace.figure.parts if trace.figure else ()):
            assert trace.figure is not None
            link = in_one_line(part.link)
            kind, size, corners = marker.CUBE, part.size, np.zeros((0, 3))
            if part.mesh is not None:
                kind = marker.TRIANGLE_LIST
                corners = trace.figure.meshes[part.mesh].triangles.reshape(-1, 3)
            found.append(
                self._marker(start, link, "robot", k, kind, part.pose, size or ONE, METAL, corners)
            )
        return self._message("visualization_msgs/msg/MarkerArray", markers=found)

    def _marker(
        self,
        start: int,
        frame: str,
        namespace: str,
        number: int,
        kind: int,
        pose: Pose,
        size: Sequence[float],
        colour: Sequence[float],
        corners: Sequence[Sequence[float]] | FloatArray = (),
    ) -> Any:
        stamp = self._stamp(start)
        transform = self._transform(pose.as_array())
        point = self._store.types["geometry_msgs/msg/Point"]
        position = point(*map(float, pose.position))
        return self._message(
            "visualization_msgs/msg/Marker",
            header=self._message("std_msgs/msg/Header", stamp=stamp, frame_id=frame),
            ns=namespace,
            id=number,
            type=kind,
            action=0,
            pose=self._message(
                "geometry_msgs/msg/Pose", position=position, orientation=transform.rotation
            ),
            scale=self._message("geometry_msgs/msg/Vector3", **dict(zip("xyz", size, strict=True))),
            color=self._message("std_msgs/msg/ColorRGBA", **dict(zip("rgba", colour, strict=True))),
            lifetime=self._message("builtin_interfaces/msg/Duration", sec=0, nanosec=0),
            frame_locked=True,
            points=[point(*map(float, corner)) for corner in corners],
            colors=[],
            texture_resource="",
            texture=self._message(
                "sensor_msgs/msg/CompressedImage",
                header=self._message("std_msgs/msg/Header", stamp=stamp, frame_id=""),
                format="",
                data=np.zeros(0, dtype=np.uint8),
            ),
            uv_coordinates=[],
            text="",
            mesh_resource="",
            mesh_file=self._message(
                "visualization_msgs/msg/MeshFile", filename="", data=np.zeros(0, dtype=np.uint8)
            ),
            mesh_use_embedded_materials=False,
        )

    def _topic(self, name: str, kind: str, latched: bool = False) -> Callable[[int, Any], None]:
        """Adds a topic; what writes a message of it at a time [ns]."""
        connection = self._writer.add_connection(
            name, kind, typestore=self._store, offered_qos_profiles=[_qos(latched)]
        )

        def write(now: int, message: Any) -> None:
            self._writer.write(connection, now, self._store.serialize_cdr(message, kind))

        return write

    def _message(self, kind: str, **fields: Any) -> Any:
        return self._store.types[kind](**fields)

    def _stamp(self, nanoseconds: int) -> Any:
        sec, nanosec = divmod(nanoseconds, NANOSECONDS)
        return self._message("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)

    def _transform(self, pose: FloatArray) -> Any:
        x, y, z, qw, qx, qy, qz = map(float, pose)
        return self._message(
            "geometry_msgs/msg/Transform",
            translation=self._message("geometry_msgs/msg/Vector3", x=x, y=y, z=z),
            rotation=self._message("geometry_msgs/msg/Quaternion", x=qx, y=qy, z=qz, w=qw),
        )


def frame_of(box: Box) -> str:
    """The frame of a body; no link's name has a slash."""
    return f"bodies/{in_one_line(box.name)}"


def _moving(trace: Trace) -> Iterator[tuple[str, str, FloatArray]]:
    """Frames that move: parent, child, and poses (n, 7) in the parent."""
    if trace.figure is not None:
        names = list(trace.joint_names)
        for hinge in trace.figure.hinges:
            poses = relative(hinge, trace.joints[:, 0, names.index(hinge.name)])
            yield in_one_line(hinge.parent), in_one_line(hinge.child), poses
    for k, box in enumerate(trace.free):
        yield WORLD, frame_of(box), trace.bodies[:, k, :7]


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
