"""Pieces of USD text: prims, attributes, places, masses, and the meshes that go into them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.scene import FloatArray, Pose
from pytest_simbench.scene.pose import quaternion_of


def turn_from_x(axis: FloatArray) -> tuple[float, float, float, float]:
    """Quaternion of the shortest turn from the x axis to `axis`."""
    x, y, z = axis / np.linalg.norm(axis)
    if x < -1 + 1e-12:
        return (0.0, 0.0, 0.0, 1.0)
    quaternion = np.array([1 + x, 0.0, -z, y])
    w, x, y, z = (float(value) for value in quaternion / np.linalg.norm(quaternion))
    return (w, x, y, z)


def mass_lines(mass: float, centre: FloatArray, inertia: FloatArray) -> list[str]:
    """Lines of PhysicsMassAPI.

    Args:
        mass: [kg].
        centre: of mass, in the body's frame [m].
        inertia: tensor about it, body axes, (3, 3) [kg m^2].
    """
    moments, axes = np.linalg.eigh(inertia)  # PhysX's bits, and so all tables, hang on these axes
    if np.allclose(inertia, np.diag(np.diag(inertia)), rtol=0, atol=1e-15):
        moments, axes = np.diag(inertia), np.eye(3)
    if np.linalg.det(axes) < 0:
        axes[:, 0] *= -1
    return [
        f"float physics:mass = {float(mass)!r}",
        f"point3f physics:centerOfMass = {numbers(centre)}",
        f"float3 physics:diagonalInertia = {numbers(moments)}",
        f"quatf physics:principalAxes = {numbers(quaternion_of(axes))}",
    ]


def placed(pose: Pose) -> list[str]:
    """Lines that put a prim at a pose in its parent's frame; USD writes quaternions w first."""
    return [
        f"double3 xformOp:translate = {numbers(pose.position)}",
        f"quatd xformOp:orient = {numbers(pose.quaternion)}",
        'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:orient"]',
    ]


def cube(size: Sequence[float], pose: Pose | None = None) -> list[str]:
    """Lines of a Cube prim of edge 1, scaled to `size` [m], at `pose` in its parent's frame."""
    order = '["xformOp:translate", "xformOp:orient", "xformOp:scale"]'
    return [
        "double size = 1",
        *placed(pose or Pose())[:2],
        f"float3 xformOp:scale = {numbers(size)}",
        f"uniform token[] xformOpOrder = {order}",
    ]


def hull(corners: FloatArray, triangles: NDArray[np.int_]) -> list[str]:
    """Lines of a Mesh prim that stands for its convex hull.

    Args:
        corners: (n, 3) [m].
        triangles: their numbers, (m, 3).
    """
    return [
        'uniform token physics:approximation = "convexHull"',
        f"point3f[] points = [{', '.join(numbers(point) for point in corners)}]",
        f"int[] faceVertexCounts = [{', '.join(['3'] * len(triangles))}]",
        f"int[] faceVertexIndices = [{', '.join(str(i) for i in triangles.ravel())}]",
    ]


_TYPES = {bool: "bool", int: "int", float: "float", str: "uniform token"}


def attributes(prefix: str, values: Mapping[str, Any]) -> list[str]:
    """Lines of attributes `prefix:name`, but for those that are None."""
    lines = []
    for name, value in values.items():
        if value is not None:
            text = {bool: str(value).lower(), str: f'"{value}"'}.get(type(value), repr(value))
            lines.append(f"{_TYPES[type(value)]} {prefix}:{name} = {text}")
    return lines


def numbers(values: Iterable[float]) -> str:
    """A tuple in USD's writing, with all digits."""
    return "(" + ", ".join(repr(float(value)) for value in values) + ")"


def prim(
    kind: str,
    name: str,
    schemas: Sequence[str],
    lines: Sequence[str],
    children: Sequence[str] = (),
) -> str:
    """A prim of a type with its API schemas, its attributes' lines and its children."""
    listed = ", ".join(f'"{schema}"' for schema in schemas)
    head = f'def {kind} "{name}"' + (f" (prepend apiSchemas = [{listed}])" if schemas else "")
    return "\n".join([head, "{", *lines, *children, "}"])
