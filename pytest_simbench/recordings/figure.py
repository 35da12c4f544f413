"""What a robot looks like and how its links hang together: enough to draw it without its files.

The shapes are the collision shapes, the same that every engine is given.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.description.mesh_check import read_stl
from pytest_simbench.description.urdf import MovingJoint, PreparedRobot
from pytest_simbench.scene import FloatArray, Pose, Robot, Vector3
from pytest_simbench.scene.checks import Wire, check_pose


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles: corners (n, 3) [m], and which three of them each has, (m, 3)."""

    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]

    @property
    def triangles(self) -> FloatArray:
        """The corners of each triangle, (m, 3, 3) [m]."""
        return self.vertices[self.faces].astype(float)

    @classmethod
    def from_stl(cls, path: str | Path) -> Mesh:
        """The triangles of a binary STL file, the only form that a checked robot has."""
        corners = read_stl(Path(path).read_bytes()).reshape(-1, 3)
        vertices, faces = np.unique(corners, axis=0, return_inverse=True)
        return cls(vertices.astype(np.float32), faces.reshape(-1, 3).astype(np.int32))


@dataclass(frozen=True)
class FigureShape(Wire):
    """One shape of a link, at `pose` in its frame: a box of edge lengths `size` [m], or a mesh by
    its place in `Figure.meshes`."""

    link: str
    pose: Pose
    size: Vector3 | None = None
    mesh: int | None = None


@dataclass(frozen=True)
class Figure(Wire):
    """A robot to be drawn.

    Attributes:
        root: the link that is fixed in the world, its frame the world's.
        hinges: the moving joints, parents first; their axes are unit vectors.
        urdf: the reduced robot as text, without its meshes: their paths do not travel.
    """

    unwritten: ClassVar[tuple[str, ...]] = ("meshes",)

    name: str
    root: str
    hinges: Sequence[MovingJoint]
    parts: Sequence[FigureShape]
    urdf: str
    meshes: Sequence[Mesh] = ()

    @classmethod
    def of(cls, robot: Robot) -> Figure:
        """The figure of a robot, from its files.

        Raises:
            DescriptionError: they cannot be used.
            OSError: a mesh cannot be read.
        """
        prepared = PreparedRobot(robot)
        shapes = [(link.name, shape) for link in prepared.links.values() for shape in link.shapes]
        paths = list(dict.fromkeys(shape.mesh for _, shape in shapes if shape.mesh is not None))
        return cls(
            robot.name,
            prepared.root,
            [replace(joint, axis=_unit(joint.axis)) for joint in prepared.joints],
            [
                FigureShape(name, s.pose, s.size, None if s.mesh is None else paths.index(s.mesh))
                for name, s in shapes
            ],
            _without_meshes(prepared.to_urdf()),
            [Mesh.from_stl(path) for path in paths],
        )

    @property
    def links(self) -> list[str]:
        """Names of all links, the root first, in the order of `poses`."""
        return [self.root, *(hinge.child for hinge in self.hinges)]

    def poses(self, names: Sequence[str], positions: FloatArray) -> FloatArray:
        """Where the links are in the world: position [m] and quaternion w, x, y, z.

        Args:
            positions: of these joints over time, (n, n_joints) [rad or m].

        Returns:
            (n, n_links, 7), the links in the order of `links`.
        """
        found = {self.root: np.tile(Pose().as_array(), (len(positions), 1))}
        for hinge in self.hinges:
            moved = relative(hinge, positions[:, list(names).index(hinge.name)])
            found[hinge.child] = composed(found[hinge.parent], moved)
        return np.stack([found[name] for name in self.links], axis=1)

    def checked(self) -> Figure:
        """The same, with axes of unit length, for figures that somebody else wrote.

        Raises:
            ValueError: a link hangs on none before it, or a part names what there is not.
        """
        known = {self.root}
        for hinge in self.hinges:
            check_pose(hinge.origin, f"the joint {hinge.name!r}")
            if hinge.parent not in known or hinge.child in known:
                raise ValueError(f"the link {hinge.child!r} hangs on none before it")
            known.add(hinge.child)
        for part in self.parts:
            check_pose(part.pose, f"a shape of {part.link!r}")
            if part.link not in known or (part.mesh is None) == (part.size is None):
                raise ValueError(f"a shape of {part.link!r} is none")
            if part.mesh is not None and not 0 <= part.mesh < len(self.meshes):
                raise ValueError(f"a shape of {part.link!r} has no mesh")
        return replace(self, hinges=[replace(h, axis=_unit(h.axis)) for h in self.hinges])


def relative(hinge: MovingJoint, positions: FloatArray) -> FloatArray:
    """Poses of a joint's child in its parent's frame, (n, 7), at positions (n,) [rad or m]."""
    axis = np.asarray(hinge.axis)
    moved = np.tile(Pose().as_array(), (len(positions), 1))
    if hinge.kind == "prismatic":
        moved[:, :3] = positions[:, None] * axis
    else:
        moved[:, 3] = np.cos(positions / 2)
        moved[:, 4:] = np.sin(positions / 2)[:, None] * axis
    return composed(hinge.origin.as_array()[None], moved)


def composed(a: FloatArray, b: FloatArray) -> FloatArray:
    """Poses (n, 7) given in the frames at poses `a`, (n, 7) or (1, 7)."""
    aw, av, bw, bv = a[:, 3:4], a[:, 4:], b[:, 3:4], b[:, 4:]
    twice = 2 * np.cross(av, b[:, :3])
    position = a[:, :3] + b[:, :3] + aw * twice + np.cross(av, twice)
    w = aw * bw - (av * bv).sum(axis=1, keepdims=True)
    return np.hstack([position, w, aw * bv + bw * av + np.cross(av, bv)])


def _unit(axis: Sequence[float]) -> Vector3:
    length = math.hypot(*axis)
    x, y, z = axis
    return (x / length, y / length, z / length)


def _without_meshes(urdf: str) -> str:
    root = ET.fromstring(urdf)
    for link in root.findall("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            if shape.find("geometry/mesh") is not None:
                link.remove(shape)
    return ET.tostring(root, encoding="unicode")
