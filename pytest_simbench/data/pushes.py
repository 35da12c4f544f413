"""Motion-captured runs of a real Kinova Mico2 that moves freely, or pushes a cube (Collins, Howard,
Leitner, *Quantifying the Reality Gap in Robotic Manipulation Tasks*, ICRA 2019)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pytest_simbench.data.measured import DataError, Half, Measured, MeasuredMotion, read_motions
from pytest_simbench.records.paths import whole, write_whole
from pytest_simbench.scene import FloatArray

NAME = "arm_pushes"

FOLDER = "mico_push"

FILES = ("runs.npz", "m1n6s300.urdf")

MESHES = (
    "arm_mico", "base", "finger_distal", "finger_proximal", "forearm_mico", "hand_3finger",
    "ring_big", "ring_small", "shoulder", "wrist",
)  # fmt: skip
"""Of the links and what covers their joints."""

FREE, PUSH = "Single", "CubeExp"
"""How the names of the runs begin in which the arm moves freely, and pushes the cube."""

POSE = 7


@dataclass(frozen=True)
class Command:
    """What the arm is told at a time.

    Attributes:
        time: since the first command [s].
        angles: targets of the six joints [degrees].
    """

    time: float
    angles: tuple[float, ...]


COMMANDS: Mapping[str, tuple[Command, ...]] = {
    FREE: (Command(0.0, (0.0, -100.0, 0.0, 0.0, 0.0, 0.0)),),
    PUSH: (
        Command(0.0, (0.0, 30.0, 120.0, 90.0, 0.0, 0.0)),
        Command(8.0, (0.0, -60.0, 65.0, 90.0, 0.0, 0.0)),
        Command(14.0, (0.0, -67.0, 30.0, 90.0, 0.0, 0.0)),
    ),
}
"""Of the experiments; the arm starts with all joints at 0 (`Software/Rotations.py` of the source;
the recordings hold no commands)."""


@dataclass(frozen=True, eq=False)
class ArmRun(MeasuredMotion):
    """One run.

    Attributes:
        name: in the source: the experiment and a number of four digits.
        time: of the rows [s], (n,).
        hand, cube: poses of the marker body on the hand and of the cube, (n, 7): position [m] and
            quaternion w, x, y, z, in the world, whose origin is the arm's base on the table.
    """

    name: str
    time: FloatArray
    hand: FloatArray
    cube: FloatArray

    @property
    def number(self) -> int:
        """In its experiment."""
        return int(self.name[-4:])

    @property
    def held_out(self) -> bool:
        """Each second pair of numbers is: 2 and 3, 6 and 7, and so on."""
        return self.number // 2 % 2 == 1

    def content(self) -> Iterable[bytes | np.ndarray]:
        return f"{self.name} {len(self.time)}".encode(), self.time, self.hand, self.cube

    @property
    def experiment(self) -> str:
        """`FREE` or `PUSH`, or another one of the source's."""
        return self.name[:-4]

    @property
    def displacement(self) -> float:
        """Of the cube along x, the direction of the push [m]."""
        before, after = np.median(self.cube[:60, 0]), np.median(self.cube[-50:, 0])
        return float(after - before)


@dataclass(frozen=True, eq=False)
class ArmRuns(Measured[ArmRun]):
    """Runs in the order of their names, and the arm's description.

    Attributes:
        urdf: path of the description.
    """

    urdf: Path

    def of(self, experiment: str, which: Half) -> tuple[ArmRun, ...]:
        """Runs of an experiment by which something was chosen, or those held out, or all."""
        return tuple(run for run in self.half(which) if run.name.startswith(experiment))


def read(folder: Path) -> ArmRuns | None:
    """The runs in a folder; None where they are not there.

    Raises:
        DataError: files that are broken, cut off, or something else.
    """
    paths = [folder / FOLDER / name for name in FILES]
    if not all(path.exists() for path in paths):
        return None
    runs = sorted(read_motions(paths[0], "runs", _runs), key=lambda run: run.name)
    return ArmRuns(tuple(runs), paths[1])


def _runs(arrays: Mapping[str, np.ndarray]) -> list[ArmRun]:
    """
    Raises:
        KeyError, ValueError: as `read_motions` has it.
    """
    found = []
    for name in map(str, arrays["runs"]):
        if not name[-4:].isdecimal():
            raise ValueError(f"the run {name!r:.80} has no number of four digits")
        time, hand, cube = (arrays[f"{name}/{what}"] for what in ("time", "hand", "cube"))
        n = len(time) if time.ndim == 1 else 0
        if n < 2 or hand.shape != (n, POSE) or cube.shape != (n, POSE):
            raise ValueError(f"the run {name} has arrays that do not fit each other")
        if not all(a.dtype.kind == "f" and np.isfinite(a).all() for a in (time, hand, cube)):
            raise ValueError(f"the run {name} has values that are no numbers")
        norms = np.linalg.norm([hand[:, 3:], cube[:, 3:]], axis=2)
        if np.abs(norms - 1).max() > 1e-3 or not (np.diff(time) > 0).all():
            raise ValueError(f"the run {name} has no rotations, or time that stands still")
        found.append(ArmRun(name, *(np.asarray(a, float) for a in (time, hand, cube))))
    return found


def convert(files: Mapping[str, bytes], folder: Path) -> None:
    """Write the runs and the arm's description of the source's files into a folder.

    A run is a table separated by tabs: number, time [s], then for base, hand and cube the position
    [mm], three angles, a residual, and the rotation matrix column by column.

    Raises:
        DataError: a file that holds something else.
        OSError: the folder cannot be written to.
    """
    there = folder / FOLDER
    arrays: dict[str, np.ndarray] = {}
    names = []
    for path, content in sorted(files.items()):
        file = Path(path)
        if file.suffix == ".tsv":
            names.append(file.stem.removesuffix("_6D"))
            time, hand, cube = _table(content, path)
            arrays |= {f"{names[-1]}/time": time, f"{names[-1]}/hand": hand}
            arrays[f"{names[-1]}/cube"] = cube
        else:
            place = "meshes" if file.suffix == ".STL" else "."
            write_whole(there, f"{place}/{file.name}", content)
    with whole(there, FILES[0]) as packed:
        np.savez_compressed(packed, runs=np.array(names), **arrays)  # type: ignore[arg-type]


def _table(content: bytes, path: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time, hand and cube of a run's table."""
    from scipy.spatial.transform import Rotation  # 0.2 s, and only a download asks

    try:
        rows = [line.split() for line in content.decode("ascii").splitlines()]
        numbers = np.array(rows, float)
        time, *bodies = numbers[:, 1], *np.split(numbers[:, 2:], 3, axis=1)
        poses = []
        for body in bodies[1:]:
            turns = Rotation.from_matrix(body[:, 7:16].reshape(-1, 3, 3).transpose(0, 2, 1))
            poses.append(np.hstack([body[:, :3] / 1000, turns.as_quat(scalar_first=True)]))
    except (ValueError, IndexError) as error:
        raise DataError(f"{path} is no table of a run: {error}") from None
    return time, poses[0], poses[1]
