"""Real tosses of one acrylic cube onto a table, motion-captured (Pfrommer, Halm, Posa, 2020)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pytest_simbench.data.measured import DataError, Measured, MeasuredMotion, read_motions
from pytest_simbench.data.torch_file import read_tensor
from pytest_simbench.records.paths import whole
from pytest_simbench.scene import FloatArray, Pose, Vector3

NAME = "cube_tosses"

RATE = 148.0
"""Samples a second (the source)."""

EDGE = 0.1048
"""Of the cube [m]. The source divides lengths by half of it."""

MASS = 0.37
"""[kg] (the source)."""

INERTIA = 8.1e-4
"""About each axis through the centre [kg m^2] (the source). A homogeneous cube would have 6.8e-4.
Two other values are in print: 6.167e-4 is that of a cube of 0.10 m, 8.1e-3 a misprint."""

FRICTION = 0.18
"""Coulomb coefficient of acrylic on that table: the value that was fitted to these tosses
(Pfrommer, Halm, Posa 2020; Acosta, Yang, Posa 2022). They fitted a restitution of 0.125 too, which
the task leaves out: not all engines have it."""

COLUMNS = 13
"""Of a state: position 3, quaternion 4, linear velocity 3, angular velocity 3."""

FASTEST = 100.0
"""[m], [m/s], [rad/s]. Whatever is larger is no toss of a hand."""

PATTERN = "contactnets_cube_tosses*.npz"


@dataclass(frozen=True, eq=False)
class Toss(MeasuredMotion):
    """One toss.

    Attributes:
        index: its number in the source.
        state: rows of 1/148 s, (n, 13): position [m], quaternion w, x, y, z (body to world), linear
            velocity [m/s] (world), angular velocity [rad/s] (body).
    """

    index: int
    state: FloatArray

    @property
    def number(self) -> int:
        return self.index

    def content(self) -> Iterable[bytes | np.ndarray]:
        return str((self.index, self.state.shape)).encode(), self.state

    @property
    def start(self) -> Pose:
        """Of the cube's centre, in row 0."""
        return Pose.from_array(self.state[0])

    @property
    def linear_velocity(self) -> Vector3:
        """In row 0 [m/s], in the world."""
        x, y, z = map(float, self.state[0, 7:10])
        return x, y, z

    @property
    def angular_velocity(self) -> Vector3:
        """In row 0 [rad/s], in the world; the source has it in the body's axes."""
        x, y, z = map(float, self.start.rotation() @ self.state[0, 10:13])
        return x, y, z

    @property
    def time(self) -> FloatArray:
        """Of the rows [s], (n,)."""
        return np.arange(len(self.state)) / RATE

    @property
    def duration(self) -> float:
        """From the first row to the last [s]."""
        return (len(self.state) - 1) / RATE


class Tosses(Measured[Toss]):
    """Tosses in the order of their numbers; those with even numbers are not held out."""


def read(folder: Path) -> Tosses | None:
    """The tosses in a folder, of all of its files together; None where it has no such file.

    Raises:
        DataError: a file that is broken, cut off, or something else.
    """
    found: dict[int, Toss] = {}
    for path in sorted(folder.glob(PATTERN)):
        found |= {toss.index: toss for toss in read_motions(path, "tosses", _tosses)}
    return Tosses(tuple(found[index] for index in sorted(found))) if found else None


def _tosses(arrays: Mapping[str, FloatArray]) -> list[Toss]:
    """
    Raises:
        KeyError, ValueError: as `read_motions` has it.
    """
    index, length, state = (arrays[name] for name in ("toss_index", "length", "state"))
    numbers = [a.ndim == 1 and a.dtype.kind in "iu" and len(a) for a in (index, length)]
    if not all(numbers) or len(index) != len(length):
        raise ValueError("toss_index and length must be as many whole numbers")
    if index.min() < 0 or len(set(index.tolist())) < len(index) or length.min() < 2:
        raise ValueError("toss_index has a number twice or below 0, or a toss has under 2 rows")
    if state.dtype.kind != "f" or state.shape != (length.sum(), COLUMNS):
        raise ValueError(
            f"state has the shape {state.shape}, and the lengths ask for {length.sum()} rows of "
            f"{COLUMNS} numbers"
        )
    norms = np.linalg.norm(state[:, 3:7], axis=1)
    if not (np.abs(state).max(initial=0.0) < FASTEST and np.abs(norms - 1).max() < 1e-3):
        raise ValueError("state has values that are no numbers, too large, or no rotation")
    ends = np.cumsum(length)
    rows = np.split(np.asarray(state, float), ends[:-1])
    return [Toss(int(k), part) for k, part in zip(index, rows, strict=True)]


def convert(files: Mapping[str, bytes], folder: Path) -> None:
    """Write the arrays of the source's files (`NUMBER.pt`) into a folder.

    Each holds a tensor (1, rows, 19): position 3 and velocity 3 in halves of the edge, quaternion
    4, then angular velocity 3, and 6 zeros; in the order of `COLUMNS`.

    Raises:
        DataError: a file that holds something else.
        OSError: the folder cannot be written to.
    """
    numbered = {int(Path(name).stem): content for name, content in files.items()}
    states = [_state(read_tensor(numbered[k], f"{k}.pt"), k) for k in sorted(numbered)]
    write(folder / PATTERN.replace("*", ""), sorted(numbered), states)


def write(path: Path, indices: Sequence[int], states: Sequence[FloatArray]) -> None:
    """Write tosses, whole or not at all."""
    with whole(path.parent, path.name) as file:
        np.savez_compressed(
            file,
            toss_index=np.array(indices, np.int64),
            length=np.array([len(state) for state in states], np.int64),
            state=np.concatenate(states),
        )


def _state(tensor: FloatArray, number: int) -> FloatArray:
    if tensor.ndim != 3 or tensor.shape[0] != 1 or tensor.shape[2] < COLUMNS:
        raise DataError(f"{number}.pt has the shape {tensor.shape}, not (1, rows, 19)")
    state = tensor[0, :, :COLUMNS].copy()
    state[:, [0, 1, 2, 7, 8, 9]] *= EDGE / 2
    return state
