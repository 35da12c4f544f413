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
from dataclasses import dataclass
from itertools import combinations, zip_longest
from pathlib import Path
from typing import TypedDict

import numpy as np

from pytest_simbench.client.world import Motion
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


class Facts(TypedDict):
    """What a file holds besides arrays, see `Sample`."""

    label: str
    task: str
    seed: int
    bodies: list[str]
    counts: dict[str, float | None]


@dataclass(frozen=True)
class Sample:
    """One simulator's episode as kept in the run folder.

    Attributes:
        label: simulator, with mode and profile where a reader needs them.
        task, seed: what was run; only equal ones are compared.
        bodies: names of the free bodies.
        motions: see `TapedWorld.motions`.
        commands: arm and finger positions at the end of each motion, None for waits.
        durations: of the operations [s].
        counts: of the outcome.
    """

    label: str
    task: str
    seed: int
    bodies: Sequence[str]
    motions: Sequence[Motion]
    commands: Sequence[FloatArray | None]
    durations: Sequence[float]
    counts: Mapping[str, float | None]

    @classmethod
    def of(cls, episode: Episode, label: str, task: str, seed: int) -> Sample:
        commands = [
            None if o.kind == "wait" else np.asarray(o.arguments["position"][-1], dtype=float)
            for o in episode.tape
        ]
        durations = [operation.duration for operation in episode.tape]
        bodies, motions, counts = list(episode.bodies), episode.motions, episode.counts
        return cls(label, task, seed, bodies, motions, commands, durations, counts)

    @property
    def asked(self) -> list[FloatArray]:
        """Of each operation its duration [s] and, if it is a motion, the positions at its end."""
        pairs = zip(self.durations, self.commands, strict=False)
        return [np.array([lasting, *([] if goal is None else goal)]) for lasting, goal in pairs]

    def save(self, folder: Path, name: str) -> None:
        """Write it as .npz into a run folder.

        Raises:
            OSError: the folder cannot be written to.
        """
        joined = Motion.joined(list(self.motions))
        width = max((len(c) for c in self.commands if c is not None), default=0)
        commands = [np.full(width, np.nan) if c is None else c for c in self.commands]
        facts = Facts(
            label=self.label, task=self.task, seed=self.seed, bodies=list(self.bodies),
            counts=dict(self.counts),
        )  # fmt: skip
        file = io.BytesIO()
        np.savez_compressed(
            file,
            facts=np.array(json.dumps(facts)),
            time=joined.time,
            joints=joined.joints,
            bodies=joined.bodies,
            lengths=np.array([len(motion) for motion in self.motions]),
            commands=np.array(commands).reshape(len(commands), width),
            durations=np.array(self.durations),
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
            if not _fits(data, len(facts["bodies"])):
                raise ValueError("its arrays do not fit each other")
        except (ValueError, KeyError, TypeError) as error:
            raise ValueError(f"{path} holds no motion of pytest-simbench: {error}") from None
        cuts = np.cumsum(data["lengths"])[:-1]
        parts = (np.split(data[name], cuts) for name in ("time", "joints", "bodies"))
        motions = [Motion(*part) for part in zip(*parts, strict=True)]
        commands = [None if np.isnan(row).all() else row for row in data["commands"]]
        durations = [float(value) for value in data["durations"]]
        return cls(**facts, motions=motions, commands=commands, durations=durations)


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
        body: the cube.
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
        first, second: their labels.
        partings: by distance [m]; None: they never differ so much.
        commands_part: simulated time of the first operation whose set points or duration differ
            [s]; None: all commands are the same.
        until: how long both episodes lasted [s].
        same_outcome: whether the task's counts are the same.
    """

    first: str
    second: str
    partings: Mapping[float, Parting | None]
    commands_part: float | None
    until: float
    same_outcome: bool


def agreement(first: Sample, second: Sample) -> Agreement:
    """Compare two simulators' episodes of one task and seed.

    Raises:
        ValueError: they are of different tasks, seeds or scenes.
    """
    mine, other = [(s.task, s.seed, tuple(s.bodies)) for s in (first, second)]
    if mine != other:
        raise ValueError(f"{first.label} ran {mine[:2]}, {second.label} ran {other[:2]}")
    between = gaps(first.motions, second.motions)

    def parting(limit: float) -> Parting | None:
        found = between.first_beyond(limit)
        if found is None:
            return None
        x, y, z = (float(value) for value in between.position[found])
        return Parting(float(between.time[found[0]]), first.bodies[found[1]], (x, y, z))

    return Agreement(
        first.label,
        second.label,
        {limit: parting(limit) for limit in LIMITS},
        _commands_part(first, second),
        float(between.time[-1]),
        dict(first.counts) == dict(second.counts),
    )


def _commands_part(first: Sample, second: Sample) -> float | None:
    for number, (a, b) in enumerate(zip_longest(first.asked, second.asked)):
        same = a is not None and b is not None and a.shape == b.shape
        if not same or not np.allclose(a, b, rtol=0, atol=SAME_COMMAND):
            return float(first.motions[min(number, len(first.motions) - 1)].time[-1])
    return None


def agreements(folder: Path) -> list[Agreement]:
    """All pairs of what a run left in its folder, task by task and seed by seed."""
    names = sorted(path.name for path in inside(folder, FOLDER).glob("*.npz"))
    samples = [Sample.load(inside(folder, f"{FOLDER}/{name}")) for name in names]
    return [
        agreement(a, b)
        for a, b in combinations(samples, 2)
        if (a.task, a.seed, tuple(a.bodies)) == (b.task, b.seed, tuple(b.bodies))
    ]
