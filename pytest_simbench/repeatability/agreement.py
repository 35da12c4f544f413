"""Do simulators agree? For one seed: when and where their cubes first differ by 1 mm and 1 cm.

Each simulator runs the task by itself, in a test of its own, and leaves its motion in the run
folder; they are compared when all have run. The commands come from the same planner with the
same seed. They stay the same until the planner looks at cubes that stand elsewhere, so the time
from which the set points differ is told as well.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from itertools import combinations, zip_longest
from pathlib import Path

import numpy as np

from pytest_simbench.client.motion import Motion
from pytest_simbench.ground.files import read_arrays, read_json
from pytest_simbench.records import checked
from pytest_simbench.records.paths import inside, write_whole
from pytest_simbench.repeatability.episode import Episode
from pytest_simbench.repeatability.motions import gaps
from pytest_simbench.scene import FloatArray

LIMITS = (0.001, 0.01)
"""Distances of interest [m]."""

SAME_COMMAND = 1e-3
"""Set points closer than this count as the same [rad, m]: planned for the same poses to within
what an inverse kinematics solver leaves."""

FOLDER = "motions"

LARGEST = 256 * 2**20
"""Of a file, packed and unpacked [bytes]; a whole stacking has 7 MB."""


@dataclass(frozen=True)
class Facts:
    """What was run, in the file beside the arrays.

    Attributes:
        label: simulator, with mode and profile where a reader needs them.
        task, seed, test, parameters: what was run: of the test what its simulator does not change,
            and of the task as JSON. Only equal ones are compared.
    """

    label: str
    task: str
    seed: int
    bodies: Sequence[str]
    counts: Mapping[str, float | None]
    test: str = field(default="", kw_only=True)
    parameters: str = field(default="", kw_only=True)

    @property
    def what(self) -> tuple[str, str]:
        """What was run, in words, and the parameters."""
        told = (self.task, f"seed {self.seed}", self.test)
        return ", ".join(filter(None, told)), self.parameters


@dataclass(frozen=True)
class Sample(Facts):
    """One simulator's episode as kept in the run folder.

    Attributes:
        motions: see `TapedWorld.motions`.
        asked: of each operation its duration [s], then the positions of arm and fingers at its
            end, which are not a number for waits, (n, 1 + n_joints).
    """

    motions: Sequence[Motion]
    asked: FloatArray

    @classmethod
    def of(cls, episode: Episode, label: str, task: str, seed: int) -> Sample:
        ends = [o.arguments["position"][-1] for o in episode.tape if o.kind != "wait"]
        asked = np.full((len(episode.tape), 1 + max(map(len, ends), default=0)), np.nan)
        asked[:, 0] = [operation.duration for operation in episode.tape]
        asked[[o.kind != "wait" for o in episode.tape], 1:] = ends or np.nan
        return cls(label, task, seed, episode.bodies, episode.counts, episode.motions, asked)

    def save(self, folder: Path, name: str) -> None:
        """Write it as .npz into a run folder.

        Raises:
            OSError: the folder cannot be written to.
        """
        joined = Motion.joined(list(self.motions))
        facts = {field.name: getattr(self, field.name) for field in fields(Facts)}
        file = io.BytesIO()
        np.savez_compressed(
            file,
            facts=np.array(json.dumps(facts)),
            time=joined.time,
            joints=joined.joints,
            bodies=joined.bodies,
            lengths=np.array([len(motion) for motion in self.motions]),
            commands=self.asked[:, 1:],
            durations=self.asked[:, 0],
        )
        write_whole(folder, name, file.getvalue())

    @classmethod
    def load(cls, path: Path) -> Sample:
        """Read it back.

        Raises:
            ValueError: something else is in the file, which the message names.
        """
        data = read_arrays(path, LARGEST)
        try:
            facts = checked.convert(read_json(str(data["facts"])), Facts)
            if not _fits(data, len(facts.bodies)):
                raise ValueError("its arrays do not fit each other")
        except (ValueError, KeyError, TypeError) as error:
            raise ValueError(f"{path} holds no motion of pytest-simbench: {error}") from None
        cuts = np.cumsum(data["lengths"])[:-1]
        parts = (np.split(data[name], cuts) for name in ("time", "joints", "bodies"))
        motions = [Motion(*part) for part in zip(*parts, strict=True)]
        asked = np.column_stack([data["durations"], data["commands"]])
        return cls(**vars(facts), motions=motions, asked=asked)


def _fits(data: Mapping[str, np.ndarray], bodies: int) -> bool:
    """Whether the arrays of a file are what `Sample.save` writes of so many bodies.

    Raises:
        KeyError, TypeError: they are not.
    """
    time, lengths, durations = data["time"], data["lengths"], data["durations"]
    return (
        all(data[name].dtype.kind == "f" for name in ("time", "joints", "bodies", "commands"))
        and (lengths.ndim, lengths.dtype.kind, durations.dtype.kind) == (1, "i", "f")
        and len(lengths) > 0
        and int(lengths.min()) > 0
        and time.shape == (int(lengths.sum()),)
        and data["bodies"].shape == (len(time), bodies, 13)
        and data["joints"].shape[:2] == (len(time), 2)
        and data["commands"].ndim == 2
        and durations.shape == (len(data["commands"]),)
        and all(np.isfinite(data[name]).all() for name in ("time", "bodies", "durations"))
        and bool((np.diff(time) >= 0).all())
    )


@dataclass(frozen=True)
class Parting:
    """Where two simulators first differ by a distance.

    Attributes:
        time: simulated, in the first one [s].
        position: of the cube in the first one [m].
    """

    time: float
    body: str
    position: tuple[float, float, float]

    def __str__(self) -> str:
        place = ", ".join(f"{value:.2f}" for value in self.position)
        return f"{self.time:.2f} s, {self.body} at ({place})"


@dataclass(frozen=True)
class Agreement:
    """Two simulators and one seed.

    Attributes:
        what: see `Facts`.
        partings: by distance [m]; None: they never differ so much.
        commands_part: simulated time of the first operation whose set points or duration differ
            [s]; None: all commands are the same.
        until: how long both episodes lasted [s].
        same_outcome: whether the task's counts are the same.
    """

    what: tuple[str, str]
    first: str
    second: str
    partings: Mapping[float, Parting | None]
    commands_part: float | None
    until: float
    same_outcome: bool


def agreement(first: Sample, second: Sample) -> Agreement:
    """Compare two simulators' episodes of one task, seed and scene."""
    between = gaps(first.motions, second.motions)

    def parting(limit: float) -> Parting | None:
        found = between.first_beyond(limit)
        if found is None:
            return None
        x, y, z = (float(value) for value in between.position[found])
        return Parting(float(between.time[found[0]]), first.bodies[found[1]], (x, y, z))

    return Agreement(
        first.what,
        first.label,
        second.label,
        {limit: parting(limit) for limit in LIMITS},
        _commands_part(first, second),
        float(between.time[-1]),
        dict(first.counts) == dict(second.counts),
    )


def _commands_part(first: Sample, second: Sample) -> float | None:
    for number, rows in enumerate(zip_longest(first.asked, second.asked, fillvalue=np.empty(0))):
        a, b = (row[np.isfinite(row)] for row in rows)
        if a.shape != b.shape or not np.allclose(a, b, rtol=0, atol=SAME_COMMAND):
            return float(first.motions[min(number, len(first.motions) - 1)].time[-1])
    return None


def agreements(folder: Path) -> list[Agreement]:
    """All pairs of simulators that ran the same, of what a run left in its folder."""
    names = sorted(path.name for path in inside(folder, FOLDER).glob("*.npz"))
    samples = [Sample.load(inside(folder, f"{FOLDER}/{name}")) for name in names]
    return [
        agreement(a, b)
        for a, b in combinations(samples, 2)
        if (a.what, tuple(a.bodies)) == (b.what, tuple(b.bodies)) and a.label != b.label
    ]
