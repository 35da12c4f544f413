"""Stored starts of a scene: poses of its free bodies, many times over."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pytest_simbench.ground.errors import DescriptionError
from pytest_simbench.ground.files import FileError, read_arrays
from pytest_simbench.scene import FloatArray, Pose, Scene, Start
from pytest_simbench.scene.checks import UNIT_TOLERANCE

LARGEST = 64 * 2**20
"""Of a file of starts [bytes]."""


def read_starts(path: str | Path, scene: Scene) -> tuple[Start, ...]:
    """The starts in a `.npz` file: for each body named in it an array (n, 7), position [m] and
    quaternion w, x, y, z of the frame that the scene's file gives it, in the file's world.

    Raises:
        DescriptionError: no such file, no free body of such a name, no such arrays; one sentence.
    """
    try:
        arrays = read_arrays(path, LARGEST)
    except FileError as error:
        raise DescriptionError(str(error)) from None
    names = [body.name for body in scene.free_bodies]
    if unknown := sorted(arrays.keys() - set(names)):
        raise DescriptionError(
            f"{path} holds starts of {unknown[0]!r}, which is no free body of scene "
            f"{scene.name!r}; it has {', '.join(names)}"
        )
    counts = {len(array) for array in arrays.values() if array.ndim == 2 and array.shape[1] == 7}
    bad = any(array.ndim != 2 or array.shape[1] != 7 for array in arrays.values())
    if bad or len(counts) != 1 or 0 in counts:
        raise DescriptionError(
            f"{path} must hold an array (n, 7) for each body, of the same n, 1 or more: position "
            "[m] and quaternion w, x, y, z"
        )
    for name, array in arrays.items():
        if array.dtype.kind not in "fiu" or not np.isfinite(array).all():
            raise DescriptionError(f"{path}: the starts of {name!r} are not all finite numbers")
        wrong = np.abs(np.linalg.norm(array[:, 3:], axis=1) - 1) > UNIT_TOLERANCE
        if wrong.any():
            row = int(np.argmax(wrong))
            raise DescriptionError(
                f"{path}: the quaternion of {name!r} in row {row} has no unit length"
            )
    rows = range(counts.pop())
    bodies, lift = tuple(sorted(arrays)), scene.file_lift
    return tuple(
        Start(
            bodies,
            tuple(Pose.from_array(arrays[name][row]).translated(z=lift) for name in bodies),
        )
        for row in rows
    )


def distinct(starts: Sequence[Start], scene: Scene, tolerance: float = 1e-6) -> int:
    """How many of the starts are different: in joints, in what their drives are told, and in the
    free bodies, those that no start moves too, seen from the first of them.

    Starts that place the same things alike elsewhere on a table are one experiment, done again.
    Positions [m] and quaternions are the same up to `tolerance`.
    """
    still = {body.name: body.pose for body in scene.free_bodies}
    seen: list[FloatArray] = []
    for start in starts:
        places = still | dict(zip(start.bodies, start.poses, strict=True))
        first, *others = places.values() or [Pose()]
        rows = np.array([(first.inverse() * pose).as_array() for pose in others]).reshape(-1, 7)
        rows[rows[:, 3] < 0, 3:] *= -1
        joints = start.positions, start.targets or start.positions, start.speeds, start.efforts
        none = (0.0,) * len(start.positions)
        found = np.array([*rows.ravel(), *(value for each in joints for value in each or none)])
        if not any(np.allclose(found, known, atol=tolerance) for known in seen):
            seen.append(found)
    return len(seen)
