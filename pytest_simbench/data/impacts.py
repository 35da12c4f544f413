"""Real impacts of a square that falls in a vertical plane onto a table, 250 Hz.

Recorded by Fazeli and others, kept by DAIRLab (github.com/DAIRLab/ImpactModeling). The source's
velocities are differences of its positions, row by row. Here velocities are those of arcs of free
flight that are fitted to the positions before and after an impact.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pytest_simbench.data.measured import DataError, Measured, MeasuredMotion, read_motions
from pytest_simbench.records.paths import whole
from pytest_simbench.scene import STANDARD_GRAVITY, FloatArray

NAME = "planar_impacts"

PATHS = ("planar_impacts/planar_square.npz", "planar_square.npz")
"""Where a folder of data sets has it."""

RATE = 250.0
"""Samples a second (the source)."""

SIDE = 0.06
"""Of the square [m] (the source)."""

ANGLE_BIAS = np.radians(-1.95)
"""What the source's angle reads when the square lies flat, the median of the tosses with even
numbers (95 % interval -1.99 to -1.91 degrees)."""

MOMENT = 5.2e-4
"""Of the square about its centre, over its mass [m^2]. The source has none. An impulse at the
corner that strikes explains the impacts of the tosses with even numbers best with 5.2e-4 (95 %
interval 5.0e-4 to 5.3e-4); a homogeneous square would have 6e-4."""

FLIGHT = 10
"""Rows of an arc of free flight, 36 ms from the first to the last."""

KICK = 0.4
"""A change of velocity from row to row that no free flight has [m/s]: there it is 0.11 at most in
95 % of the tosses."""

NEAR = 0.25e-3
"""How well rows fit an arc (root of the mean square), and how near the arcs before and after must
come to each other [m]: an arc of free flight has 0.07 mm."""

TABLE = 3e-3
"""How high above the table, or below it, the corner may read when it strikes [m]."""

LEAST_TILT = np.radians(5.0)
"""From lying flat: below it two corners may strike."""

SCALE = np.array([1.0, 1.0, np.sqrt(MOMENT)])
"""Makes lengths of x, z and angle, and speeds of their rates: the square of such a speed is twice
the kinetic energy over the mass."""

_G = -STANDARD_GRAVITY[2]


@dataclass(frozen=True, eq=False)
class Impact(MeasuredMotion):
    """One corner strikes, once. Vectors are of x, z [m] and the angle from x to z [rad], or rates.

    Attributes:
        toss: its number in the source.
        order: among the toss's impacts, clean or not, from 0.
        place: of the centre at the impact, (3,), so high that the striking corner touches z = 0.
        before, after: the velocities at the impact, (3,).
    """

    toss: int
    order: int
    place: FloatArray
    before: FloatArray
    after: FloatArray

    @property
    def number(self) -> int:
        """100 times the toss's, and the impact's order in it."""
        return 100 * self.toss + self.order

    @property
    def held_out(self) -> bool:
        """As its toss is, by the toss's number."""
        return self.toss % 2 == 1

    def content(self) -> Iterable[bytes | np.ndarray]:
        return str(self.number).encode(), np.concatenate([self.place, self.before, self.after])

    def flying(self, time: float) -> tuple[FloatArray, FloatArray]:
        """Place and velocity that long before the impact [s], by its velocity before."""
        fall = np.array([0.0, _G, 0.0])
        place: FloatArray = self.place - self.before * time - fall * time**2 / 2
        velocity: FloatArray = self.before + fall * time
        return place, velocity

    def left(self, time: float) -> FloatArray:
        """The velocity that long after the impact [s], still in free flight."""
        velocity: FloatArray = self.after - np.array([0.0, _G * time, 0.0])
        return velocity


class Impacts(Measured[Impact]):
    """Impacts in the order of their numbers; those of tosses with even numbers are not held out."""


def read(folder: Path) -> Impacts | None:
    """The impacts of the tosses in a folder; None where it has none.

    Raises:
        DataError: a file that is broken, cut off, or something else.
    """
    for path in (folder / name for name in PATHS):
        if path.is_file():
            return Impacts(tuple(read_motions(path, "impacts", _impacts)))
    return None


def clean_impacts(toss: int, rows: FloatArray) -> list[Impact]:
    """The clean impacts of a toss, whose rows are x, z [m] and angle [rad], (n, 3).

    Clean is one that has two arcs of free flight, of `FLIGHT` rows, with one row between them or
    none, which meet in between, where one corner alone is near the table, and is pushed up.
    """
    rows = rows - [0.0, 0.0, ANGLE_BIAS]
    change = np.diff(rows, 2, axis=0) * RATE + [0.0, _G / RATE, 0.0]
    kicked = np.flatnonzero(np.linalg.norm(change * SCALE, axis=1) > KICK) + 1
    if not len(kicked):
        return []
    groups = np.split(kicked, np.flatnonzero(np.diff(kicked) > 1) + 1)
    ends = [(int(group[0]), int(group[-1])) for group in groups]
    ends = [(a - 1, b + 1) if a == b else (a, b) for a, b in ends]  # on which arc that row is?
    found = []
    for order, (last, first) in enumerate(ends):
        begin = ends[order - 1][1] if order else 0
        end = ends[order + 1][0] if order + 1 < len(ends) else len(rows) - 1
        if first - last <= 2 and last - begin + 1 >= FLIGHT <= end - first + 1:
            before, after = _arc(rows, last - FLIGHT + 1, last), _arc(rows, first, last)
            found += _meeting(toss, order, before, after, (first - last) / RATE)
    return found


Arc = tuple[FloatArray, FloatArray, float]
"""Place and velocity at a time, and how far its rows are from it (root of the mean square) [m]."""


def _arc(rows: FloatArray, first: int, at: int) -> Arc:
    """Free flight fitted to rows from `first` on, told at row `at`."""
    time = (np.arange(first, first + FLIGHT) - at) / RATE
    fallen = rows[first : first + FLIGHT] + np.outer(_G * time**2 / 2, [0.0, 1.0, 0.0])
    design = np.stack([np.ones(FLIGHT), time], axis=1)
    place, velocity = np.linalg.lstsq(design, fallen, rcond=None)[0]
    off = (fallen - design @ [place, velocity]) * SCALE
    return place, velocity, float(np.sqrt((off**2).sum(axis=1).mean()))


def _meeting(toss: int, order: int, before: Arc, after: Arc, between: float) -> list[Impact]:
    """The impact at which two arcs meet that have that time between them [s], if it is clean."""
    apart, parting = ((b - a) * SCALE for a, b in zip(before[:2], after[:2], strict=True))
    time = -float(apart @ parting) / float(parting @ parting)
    fall = np.array([0.0, _G * time, 0.0])
    place: FloatArray = before[0] + before[1] * time - fall * time / 2
    height = -corner(place[2])[1]
    good = (
        np.linalg.norm(apart + parting * time) <= NEAR
        and max(before[2], after[2]) <= NEAR
        and 0 <= time <= between
        and abs(place[1] - height) <= TABLE
        and abs(tilt(place[2])) >= LEAST_TILT
        and parting[1] > abs(parting[0])  # else it struck something at its side
    )
    place[1] = height
    return [Impact(toss, order, place, before[1] - fall, after[1] - fall)] if good else []


def tilt(angle: float) -> float:
    """From the nearest angle at which the square lies flat [rad]."""
    return float((angle + np.pi / 4) % (np.pi / 2) - np.pi / 4)


def corner(angle: float) -> FloatArray:
    """The lowest corner from the centre, x and z [m]."""
    down = tilt(angle)
    x = np.sin(down) - np.sign(down) * np.cos(down)
    found: FloatArray = SIDE / 2 * np.array([x, -np.cos(down) - abs(np.sin(down))])
    return found


def _impacts(arrays: Mapping[str, Any]) -> list[Impact]:
    """
    Raises:
        KeyError, ValueError: as `read_motions` has it.
    """
    number, state = arrays["number"], arrays["state"]
    if number.ndim != 1 or number.dtype.kind not in "iu" or len({*number.tolist()}) < len(number):
        raise ValueError("number must be whole numbers, each once")
    if state.dtype.kind != "f" or state.ndim != 3 or (len(state), state.shape[2]) != (
        len(number), 6
    ):  # fmt: skip
        raise ValueError(f"state has the shape {state.shape}, not ({len(number)}, rows, 6)")
    if state.shape[1] < 2 * FLIGHT or not np.abs(state[:, :, :3]).max(initial=0.0) < 100.0:
        raise ValueError("state has too few rows, or values that are too large or no numbers")
    order = np.argsort(number)
    rows = state[order, :, :3].astype(float)
    tosses = zip(number[order].tolist(), rows, strict=True)
    return [impact for toss, path in tosses for impact in clean_impacts(toss, path)]


def convert(files: Mapping[str, bytes], folder: Path) -> None:
    """Write the array of the source's files (`traj_NUMBER.csv`) into a folder.

    Raises:
        DataError: a file that holds something else.
        OSError: the folder cannot be written to.
    """
    found: dict[int, FloatArray] = {}
    for name, content in files.items():
        if name.endswith(".csv"):
            try:
                rows = np.genfromtxt(content.decode().splitlines(), delimiter=",", skip_header=1)
                found[int(Path(name).stem.removeprefix("traj_"))] = rows.reshape(-1, 6)
            except ValueError as error:
                raise DataError(f"{name} holds no toss: {error}") from None
    numbers = sorted(found)
    with whole(folder, Path(PATHS[-1]).name) as file:
        state = np.stack([found[k] for k in numbers]).astype(np.float32)
        np.savez_compressed(file, number=np.array(numbers, np.int64), state=state)
