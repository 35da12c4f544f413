"""The motion of one repetition, and what moved: one `.npz` file that stands for itself.

    time          simulated [s], (n,)
    joints        positions and velocities, (n, 2, n_joints) [rad, rad/s, or m, m/s]
    bodies        rows as `World.bodies`, (n, n_free, 13)
    joint_names, body_names
    about         JSON in bytes: the boxes of the scene, the robot's `Figure`, the phases
    vertices_K, faces_K    the robot's meshes

Positions and quaternions are rounded to 1e-6, velocities to 1e-5, and kept with single precision,
each column by itself: the rounding noise of bodies at rest would be nine tenths of the file.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from pytest_simbench.client.motion import Motion
from pytest_simbench.ground.files import FileError, read_arrays, read_json
from pytest_simbench.recordings.figure import Figure, Mesh
from pytest_simbench.records.checked import convert, plain
from pytest_simbench.records.paths import whole
from pytest_simbench.scene import Body, FloatArray, Scene

LARGEST = 512 * 2**20
"""Of a trace when it is read [bytes]."""

LATEST = 2**31 - 1
"""Of simulated time [s]; the stamps of ROS hold no more."""

FOLDER = "traces"
"""In the run folder."""


class TraceError(ValueError):
    """A file that is no trace; the message is a whole sentence."""


@dataclass(frozen=True, eq=False)
class Trace:
    """The motion of one repetition, see the module.

    Attributes:
        time, joints, bodies: see the module.
        boxes: all bodies of the scene, the free ones in the order of `body_names`, as they began.
        figure: the robot; None for a scene without one.
        phases: when each began [s], and its name, in the order of time.
    """

    time: FloatArray
    joints: FloatArray
    bodies: FloatArray
    joint_names: Sequence[str]
    body_names: Sequence[str]
    boxes: Sequence[Body]
    figure: Figure | None
    phases: Sequence[tuple[float, str]] = ()

    @classmethod
    def of(cls, scene: Scene, motion: Motion, phases: Sequence[tuple[float, str]]) -> Trace:
        """What was sampled of a world, up to the first number that is not finite.

        Raises:
            DescriptionError, OSError: the robot's files cannot be read any more.
        """
        robot = scene.robot
        finite = np.isfinite(motion.joints).all((1, 2)) & np.isfinite(motion.bodies).all((1, 2))
        end = int(np.argmin(np.append(finite, False)))
        return cls(
            motion.time[:end],
            motion.joints[:end],
            motion.bodies[:end],
            robot.joint_names if robot else (),
            [body.name for body in scene.free_bodies],
            [*scene.free_bodies, *scene.fixed_bodies],
            None if robot is None else Figure.of(robot),
            # A phase in which no time passes is not seen.
            [
                phase
                for phase, after in zip_longest(phases, phases[1:])
                if after is None or after[0] > phase[0]
            ],
        )

    @property
    def free(self) -> Sequence[Body]:
        """The bodies that move, in the order of the rows of `bodies`."""
        return self.boxes[: len(self.body_names)]

    @property
    def fixed(self) -> Sequence[Body]:
        """The bodies that do not."""
        return self.boxes[len(self.body_names) :]

    def links(self) -> FloatArray:
        """Poses of the robot's links in the world, (n, n_links, 7), in the order of
        `Figure.links`; none without a robot."""
        if self.figure is None:
            return np.zeros((len(self.time), 0, 7))
        return self.figure.poses(self.joint_names, self.joints[:, 0])

    def write(self, folder: Path, name: str) -> None:
        """Write a file of a run folder, whole or not at all.

        Raises:
            OSError: it cannot be written.
        """
        about = {
            "boxes": [box.to_wire() for box in self.boxes],
            "figure": None if self.figure is None else self.figure.to_wire(),
            "phases": [[float(time), name] for time, name in self.phases],
        }
        meshes: dict[str, Any] = {}
        for k, mesh in enumerate(self.figure.meshes if self.figure else ()):
            meshes |= {f"vertices_{k}": mesh.vertices, f"faces_{k}": mesh.faces}
        with whole(folder, name) as file:
            np.savez_compressed(
                file,
                time=self.time,
                joints=_rounded(self.joints[:, :1], self.joints[:, 1:], axis=1),
                bodies=_rounded(self.bodies[:, :, :7], self.bodies[:, :, 7:], axis=2),
                joint_names=np.array(self.joint_names, dtype=np.str_),
                body_names=np.array(self.body_names, dtype=np.str_),
                about=np.frombuffer(json.dumps(about).encode(), dtype=np.uint8),
                **meshes,
            )

    @classmethod
    def read(cls, path: Path) -> Trace:
        """The trace of a file that anybody may have made.

        Raises:
            TraceError: it is none.
        """
        try:
            arrays = read_arrays(path, LARGEST)
            if "about" not in arrays:
                raise ValueError("it is of an older version, which did not keep the scene")
            about = read_json(arrays["about"].tobytes())
            return cls._checked(arrays, about)
        except FileError as error:
            raise TraceError(f"{error}") from None
        except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError) as error:
            told = f"it lacks {error}" if isinstance(error, KeyError) else error
            raise TraceError(f"{path} is no trace of a repetition: {told}") from None

    @classmethod
    def _checked(cls, arrays: dict[str, np.ndarray], about: Any) -> Trace:
        count = len([name for name in arrays if name.startswith("faces_")])
        meshes = [Mesh(arrays[f"vertices_{k}"], arrays[f"faces_{k}"]) for k in range(count)]
        for mesh in meshes:
            _like(mesh.vertices, (None, 3), "meshes' vertices")
            _like(mesh.faces, (None, 3), "meshes' faces")
            if not np.issubdtype(mesh.faces.dtype, np.integer) or (
                len(mesh.faces)
                and not 0 <= mesh.faces.min() <= mesh.faces.max() < len(mesh.vertices)
            ):
                raise ValueError("a face of a mesh has no vertices")
        figure = plain(about["figure"])
        found = cls(
            _like(arrays["time"], (None,), "time"),
            np.ascontiguousarray(arrays["joints"], dtype=float),
            np.ascontiguousarray(arrays["bodies"], dtype=float),
            [str(name) for name in arrays["joint_names"]],
            [str(name) for name in arrays["body_names"]],
            [Body.from_wire(box) for box in about["boxes"]],
            None if figure is None else replace(convert(figure, Figure), meshes=meshes).checked(),
            [(float(time), str(name)) for time, name in about["phases"]],
        )
        rows = len(found.time)
        _like(found.joints, (rows, 2, len(found.joint_names)), "joints")
        _like(found.bodies, (rows, len(found.body_names), 13), "bodies")
        if not rows or not (np.diff(found.time) > 0).all():
            raise ValueError("its time does not go on")
        times = [found.time[-1], *(abs(time) for time, _ in found.phases)]
        if found.time[0] < 0 or not all(time <= LATEST for time in times):
            raise ValueError(f"its time is not from 0 to {LATEST} s")
        if [box.name for box in found.free] != list(found.body_names):
            raise ValueError("its bodies are not those of its scene")
        moving = [hinge.name for hinge in found.figure.hinges] if found.figure else []
        if missing := set(moving) - set(found.joint_names):
            raise ValueError(f"it has no positions of the joints {sorted(missing)}")
        return found


def _rounded(positions: FloatArray, velocities: FloatArray, axis: int) -> np.ndarray:
    """Both as one array that packs well, see the module."""
    found = np.concatenate([positions.round(6), velocities.round(5)], axis)
    return np.asfortranarray(found, dtype=np.float32)


def _like(array: np.ndarray, shape: tuple[int | None, ...], what: str) -> FloatArray:
    """The array, if it holds finite numbers in that shape."""
    fits = array.ndim == len(shape) and all(
        wanted in (None, size) for size, wanted in zip(array.shape, shape, strict=True)
    )
    if not fits or not np.issubdtype(array.dtype, np.number) or not np.isfinite(array).all():
        raise ValueError(f"its {what} are not finite numbers in the shape {shape}")
    return array
