"""Which cubes a thrown cube moved, and which moved for another reason.

A cube is moved by the throw when its first motion began while the flying cube touched it, or
while a cube touched it that the throw had moved before; and when that motion carried it
away. A pyramid that falls by itself, creeps, or is knocked by the arm is moved otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass

import coal
import numpy as np
from numpy.typing import NDArray

from pytest_simbench.scene import FloatArray, Pose
from pytest_simbench.scene.overlap import rotations
from pytest_simbench.tasks.base import CUBE_SIZE

BoolArray = NDArray[np.bool_]

WINDOW = 0.05
"""Motion is judged over this time, and causes are sought within it [s]."""

MOTION = 0.002
"""A body moves when its centre has gone farther than this within `WINDOW` [m]: faster than
40 mm/s. Creep is slower; a cube knocked over is not. For cubes of the study's size; it and `TOUCH`
go with the edge."""

TOUCH = 0.005
"""Bodies nearer than this touch [m]; what they move between two samples is added."""

CALM = 0.5
"""The throw's motion is over when nothing has moved for this long [s]."""


@dataclass(frozen=True)
class Impact:
    """What a throw did to the cubes.

    Attributes:
        caused: indices of the cubes whose first motion the throw caused, in the order of motion.
        rest: index of the sample at which the motion that the throw caused was over.
    """

    caused: tuple[int, ...]
    rest: int


def impact(
    time: FloatArray, thrown: FloatArray, cubes: FloatArray, edge: float, free: int
) -> Impact:
    """Follow the chain of contacts from a thrown cube.

    Args:
        time: of each sample [s], (n,).
        thrown: poses of the thrown cube, (n, 7): position [m], quaternion w, x, y, z.
        cubes: poses of the others, (n, m, 7).
        edge: of every cube [m].
        free: index of the first sample at which the thrown cube was out of the hand.
    """
    chain = _Chain(time, np.concatenate([thrown[:, None], cubes], axis=1), edge)
    moving = chain.moving
    onsets = {
        i: int(np.argmax(moving[:, i + 1])) for i in range(cubes.shape[1]) if moving[:, i + 1].any()
    }
    caused: list[int] = []
    waiting = sorted(onsets, key=lambda i: onsets[i])
    while True:
        for i in waiting:
            k = onsets[i]
            flown = moving[k, 0] and chain.touched(i + 1, 0, k, since=free)
            if flown or any(onsets[j] <= k and chain.touched(i + 1, j + 1, k) for j in caused):
                caused.append(i)
                waiting.remove(i)
                break
        else:
            break
    began = min((onsets[i] for i in caused), default=len(time) - 1)
    return Impact(tuple(caused), chain.calm_after(began))


def may_touch(poses: FloatArray, cube: int, edge: float) -> BoolArray:
    """At which samples one of the cubes may touch another one or the ground before the next, (n,).

    Args:
        poses: of all cubes, (n, m, 7).
        cube: which one it is about.
        edge: of every cube [m].
    """
    touch, box = TOUCH * edge / CUBE_SIZE, coal.Box(edge, edge, edge)
    centres = poses[:, :, :3]
    strides = np.linalg.norm(np.diff(centres, axis=0, prepend=centres[:1]), axis=2)
    between = np.linalg.norm(centres - centres[:, [cube]], axis=2) - np.sqrt(3) * edge
    reach = edge / 2 * np.abs(rotations(poses[:, cube, 3:7])[:, 2]).sum(axis=1)
    found = centres[:, cube, 2] - reach <= touch + strides[:, cube]
    for row, other in np.argwhere(between <= touch + strides + strides[:, [cube]]):
        if other != cube and not found[row]:
            apart = _distance(box, poses[row, cube], poses[row, other])
            found[row] = apart <= touch + strides[row, cube] + strides[row, other]
    return np.asarray(found)


class _Chain:
    """Motion and contact of the bodies of a log, body 0 the thrown cube."""

    def __init__(self, time: FloatArray, poses: FloatArray, edge: float) -> None:
        self.time = time
        self.poses = poses
        self.earlier = np.maximum(np.searchsorted(time, time - WINDOW, side="right") - 1, 0)
        centres = poses[:, :, :3]
        self._scale = edge / CUBE_SIZE
        moved = np.linalg.norm(centres - centres[self.earlier], axis=2)
        self.moving = moved > MOTION * self._scale
        self.strides = np.linalg.norm(np.diff(centres, axis=0, prepend=centres[:1]), axis=2)
        self._box = coal.Box(edge, edge, edge)

    def touched(self, a: int, b: int, k: int, since: int = 0) -> bool:
        """Whether two bodies touched within `WINDOW` before sample k."""
        touch = TOUCH * self._scale
        return any(
            self._distance(row, a, b) <= touch + self.strides[row, a] + self.strides[row, b]
            for row in range(max(int(self.earlier[k]), since), k + 1)
        )

    def _distance(self, row: int, a: int, b: int) -> float:
        """Between their surfaces [m], negative where they overlap."""
        return _distance(self._box, self.poses[row, a], self.poses[row, b])

    def calm_after(self, began: int) -> int:
        """The first sample after `began` that ends `CALM` without motion, or the last."""
        still_since = self.time[began]
        for k in range(began, len(self.time)):
            if self.moving[k].any():
                still_since = self.time[k]
            elif self.time[k] - still_since >= CALM:
                return k
        return len(self.time) - 1


def _distance(box: coal.Box, a: FloatArray, b: FloatArray) -> float:
    """Between the surfaces of two boxes at poses, (7,) each [m]."""
    result = coal.DistanceResult()
    coal.distance(box, _placed(a), box, _placed(b), coal.DistanceRequest(), result)
    return float(result.min_distance)


def _placed(row: FloatArray) -> coal.Transform3s:
    pose = Pose.from_array(row)
    return coal.Transform3s(pose.rotation(), np.array(pose.position))
