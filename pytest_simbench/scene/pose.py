"""Rigid poses: a position and a unit quaternion (w, x, y, z), world z up."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pytest_simbench.scene.checks import Wire

FloatArray = NDArray[np.float64]
Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


def vector3(values: Iterable[float]) -> Vector3:
    """Three numbers as plain ones."""
    x, y, z = map(float, values)
    return x, y, z


def rotation_matrix(quaternion: Sequence[float] | FloatArray) -> FloatArray:
    """Rotation matrix (3, 3) of a quaternion w, x, y, z, which is normalised first."""
    q = np.asarray(quaternion, dtype=float)
    return unit_rotation(q / np.linalg.norm(q))


def unit_rotation(unit: FloatArray) -> FloatArray:
    """The same of unit quaternions, (4,) or (4, n), without normalising: (3, 3) or (3, 3, n)."""
    w, x, y, z = unit
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_of(rotation: FloatArray) -> FloatArray:
    """Quaternion w, x, y, z of a rotation matrix: the eigenvector of Bar-Itzhack's matrix."""
    r = rotation
    k = np.zeros((4, 4))  # symmetric; of it the lower half is looked at
    k[0, 0] = r[0, 0] + r[1, 1] + r[2, 2]
    k[1, :2] = r[2, 1] - r[1, 2], r[0, 0] - r[1, 1] - r[2, 2]
    k[2, :3] = r[0, 2] - r[2, 0], r[0, 1] + r[1, 0], r[1, 1] - r[0, 0] - r[2, 2]
    k[3] = r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], r[2, 2] - r[0, 0] - r[1, 1]
    return _signed(np.linalg.eigh(k)[1][:, -1:])[:, 0]


def principal_axes(inertia: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Principal moments of a tensor, ascending, (3,), and the turn to their axes, (3, 3)."""
    moments, axes = np.linalg.eigh(inertia)
    axes = _signed(axes)
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    return moments, axes


def _signed(vectors: FloatArray) -> FloatArray:
    """Eigenvectors, as columns, of which the first number that is not about 0 is positive. Either
    sign is right, and LAPACK's depends on the processor."""
    first = (np.abs(vectors) > 1e-6).argmax(axis=0)
    return np.asarray(vectors * np.sign(vectors[first, np.arange(vectors.shape[1])]))


def turn_of_z(direction: FloatArray) -> Quaternion:
    """Quaternion of the shortest turn from the z axis to a direction."""
    x, y, z = map(float, direction)
    if z < -1 + 1e-9:
        return (0.0, 1.0, 0.0, 0.0)
    length = math.sqrt(2 + 2 * z)
    return (length / 2, -y / length, x / length, 0.0)


def quaternion_product(a: Sequence[float], b: Sequence[float]) -> Quaternion:
    """Hamilton product of two quaternions w, x, y, z: first rotate by `b`, then by `a`."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


@dataclass(frozen=True)
class Pose(Wire):
    """A rigid transform from a body's frame to the world's (or a parent's).

    Attributes:
        position: x, y, z in [m].
        quaternion: w, x, y, z; unit length.
    """

    position: Vector3 = (0.0, 0.0, 0.0)
    quaternion: Quaternion = (1.0, 0.0, 0.0, 0.0)

    @classmethod
    def at(cls, x: float, y: float, z: float, *, yaw: float = 0.0) -> Pose:
        """Pose at x, y, z [m], turned by `yaw` [rad] about the vertical."""
        return cls((x, y, z), (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)))

    @classmethod
    def from_array(cls, array: Sequence[float] | FloatArray) -> Pose:
        """Pose from (7,): position, then quaternion w, x, y, z."""
        x, y, z, qw, qx, qy, qz = (float(value) for value in array[:7])
        return cls((x, y, z), (qw, qx, qy, qz))

    def as_array(self) -> FloatArray:
        """The pose as (7,): position, then quaternion w, x, y, z."""
        return np.array([*self.position, *self.quaternion])

    def rotation(self) -> FloatArray:
        """Rotation matrix, (3, 3)."""
        return rotation_matrix(self.quaternion)

    def matrix(self) -> FloatArray:
        """Homogeneous transform, (4, 4)."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation()
        matrix[:3, 3] = self.position
        return matrix

    def __mul__(self, other: Pose) -> Pose:
        """Composition: `other` is given in this pose's frame."""
        position = self.rotation() @ np.asarray(other.position) + np.asarray(self.position)
        return Pose(vector3(position), quaternion_product(self.quaternion, other.quaternion))

    def inverse(self) -> Pose:
        """The transform back."""
        w, x, y, z = self.quaternion
        return Pose(vector3(-(self.rotation().T @ np.asarray(self.position))), (w, -x, -y, -z))

    def translated(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Pose:
        """The same orientation, moved by x, y, z [m] in the parent's frame."""
        px, py, pz = self.position
        return Pose((px + x, py + y, pz + z), self.quaternion)

    @property
    def yaw(self) -> float:
        """Angle about the vertical of the body's x axis [rad], in (-pi, pi]."""
        w, x, y, z = self.quaternion
        return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))

    def tilt(self) -> float:
        """Angle between the vertical and the body axis nearest to it [rad].

        A cube lying on any of its six faces has tilt 0.
        """
        return float(math.acos(min(1.0, float(np.abs(self.rotation()[2]).max()))))
