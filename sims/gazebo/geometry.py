"""Geometry of Gazebo's bindings and of SDF, as the scene has it."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

import numpy as np

from pytest_simbench.description.urdf import pose_of_rpy
from pytest_simbench.scene import FloatArray, Pose


def vector(found: Any) -> FloatArray:
    """A gz.math.Vector3d, (3,)."""
    return np.array([found.x(), found.y(), found.z()])


def pose(found: Any) -> Pose:
    """A gz.math.Pose3d."""
    turn = found.rot()
    return Pose.from_array([*vector(found.pos()), turn.w(), turn.x(), turn.y(), turn.z()])


def matrix(found: Any) -> FloatArray:
    """A gz.math.Matrix3d, (3, 3)."""
    return np.array([[found(row, column) for column in range(3)] for row in range(3)])


def pose_in(element: ET.Element) -> Pose:
    """The <pose> of an element of SDF: position, and angles or a quaternion."""
    found = element.find("pose")
    if found is None:
        return Pose()
    x, y, z, *turn = numbers(found)
    if found.get("rotation_format") == "quat_xyzw":
        return Pose((x, y, z), (turn[3], turn[0], turn[1], turn[2]))
    if found.get("degrees") in ("true", "1"):
        turn = list(np.radians(turn))
    return pose_of_rpy((x, y, z), turn)


def number(element: ET.Element, path: str, default: float) -> float:
    """The number at a path below an element of SDF, or SDF's default."""
    found = element.find(path)
    return default if found is None else float(found.text or "")


def truth(element: ET.Element, path: str, default: bool) -> bool:
    """The same for what is true or false."""
    found = element.find(path)
    return default if found is None else (found.text or "").strip() in ("true", "1")


def numbers(element: ET.Element) -> list[float]:
    """The numbers in an element of SDF."""
    return [float(value) for value in (element.text or "").split()]
