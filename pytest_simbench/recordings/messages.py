"""ROS 2 messages of what a trace holds: stamps, transforms, markers. Needs rosbags.

Every text in them is one printable line: a trace may be a stranger's.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from pytest_simbench.ground.text import in_one_line
from pytest_simbench.scene import FloatArray, Solid

NANOSECONDS = 10**9

INFO = 20
"""Level of a message about what is normal (rcl_interfaces/msg/Log)."""

MARKER = "visualization_msgs/msg/Marker"
SOLIDS = {"box": "CUBE", "ball": "SPHERE", "tube": "CYLINDER", "mesh": "TRIANGLE_LIST"}
"""What a marker calls the solids of a body."""

NO_CORNERS = np.zeros((0, 3))


class Messages:
    """Makes messages; their definitions are those of ROS 2 Jazzy."""

    def __init__(self) -> None:
        self.store = get_typestore(Stores.ROS2_JAZZY)

    def make(self, kind: str, **fields: Any) -> Any:
        """A message of the type `package/msg/Name`."""
        return self.store.types[kind](**fields)

    def stamp(self, nanoseconds: int) -> Any:
        """A time."""
        sec, nanosec = divmod(nanoseconds, NANOSECONDS)
        return self.make("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)

    def header(self, nanoseconds: int, frame: str) -> Any:
        """A time, and the frame in which the rest is given."""
        stamp = self.stamp(nanoseconds)
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id=in_one_line(frame))

    def transform(self, nanoseconds: int, parent: str, child: str, pose: FloatArray) -> Any:
        """Where a frame is in its parent: position [m], quaternion w, x, y, z, (7,)."""
        return self.make(
            "geometry_msgs/msg/TransformStamped",
            header=self.header(nanoseconds, parent),
            child_frame_id=in_one_line(child),
            transform=self._transform(pose),
        )

    def log(self, nanoseconds: int, name: str, text: str) -> Any:
        """A line for a log, said by `name`."""
        return self.make(
            "rcl_interfaces/msg/Log",
            stamp=self.stamp(nanoseconds),
            level=INFO,
            name=name,
            msg=in_one_line(text),
            file="",
            function="",
            line=0,
        )

    def marker(
        self, nanoseconds: int, frame: str, namespace: str, number: int, solid: Solid,
        colour: Sequence[float],
    ) -> Any:  # fmt: skip
        """A solid at its pose in a frame, with which it moves; of a mesh its triangles."""
        size, corners = solid.extents, NO_CORNERS
        if solid.kind == "mesh":
            vertices, triangles = solid.mesh
            size, corners = (1.0, 1.0, 1.0), np.asarray(vertices)[np.ravel(triangles)]
        none = np.zeros(0, dtype=np.uint8)
        point = self.store.types["geometry_msgs/msg/Point"]
        rotation = self._transform(solid.pose.as_array()).rotation
        position = point(*map(float, solid.pose.position))
        return self.make(
            MARKER,
            header=self.header(nanoseconds, frame),
            ns=namespace,
            id=number,
            type=getattr(self.store.types[MARKER], SOLIDS[solid.kind]),
            action=0,
            pose=self.make("geometry_msgs/msg/Pose", position=position, orientation=rotation),
            scale=self.make("geometry_msgs/msg/Vector3", **dict(zip("xyz", size, strict=True))),
            color=self.make("std_msgs/msg/ColorRGBA", **dict(zip("rgba", colour, strict=True))),
            lifetime=self.make("builtin_interfaces/msg/Duration", sec=0, nanosec=0),
            frame_locked=True,
            points=[point(*map(float, corner)) for corner in corners],
            colors=[],
            texture_resource="",
            texture=self.make(
                "sensor_msgs/msg/CompressedImage",
                header=self.header(nanoseconds, ""),
                format="",
                data=none,
            ),
            uv_coordinates=[],
            text="",
            mesh_resource="",
            mesh_file=self.make("visualization_msgs/msg/MeshFile", filename="", data=none),
            mesh_use_embedded_materials=False,
        )

    def _transform(self, pose: FloatArray) -> Any:
        x, y, z, qw, qx, qy, qz = map(float, pose)
        return self.make(
            "geometry_msgs/msg/Transform",
            translation=self.make("geometry_msgs/msg/Vector3", x=x, y=y, z=z),
            rotation=self.make("geometry_msgs/msg/Quaternion", x=qx, y=qy, z=qz, w=qw),
        )
