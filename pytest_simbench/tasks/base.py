"""What a task is: a scene, a procedure and a score, the same for every simulator."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar, NamedTuple

import numpy as np

from pytest_simbench.client.tape import Tape
from pytest_simbench.client.world import World
from pytest_simbench.motion.errors import RobotError
from pytest_simbench.records.metrics import Metric
from pytest_simbench.records.notes import Wait
from pytest_simbench.records.readings import Reading
from pytest_simbench.scene import Box, Pose, Robot, Scene, Vector3
from pytest_simbench.tasks.recorded import recorded

CUBE_SIZE = 0.05
"""Edge of every cube [m] (the study)."""

CUBE_MASS = 0.1
"""[kg]. The study's simulators disagreed, 0.125 to 1.0; here it is the same everywhere."""

STUDY_TOLERANCE = 0.05
"""The study counts a cube as in its place within this distance in x and in y [m]."""


ROBOT = "robot"
"""Name of the field of a task that takes the robot."""


@dataclass(frozen=True)
class Jitter:
    """Largest disturbance of each cube's start, drawn uniformly: without it, repetitions of a
    deterministic simulator would all be the same.

    Attributes:
        distance: in x and in y [m].
        angle: about the vertical [rad].
    """

    distance: float = 0.001
    angle: float = float(np.deg2rad(1.0))

    def disturbed(self, pose: Pose, rng: np.random.Generator) -> Pose:
        """`pose`, moved and turned; draws three numbers whatever the amplitudes."""
        x, y, turn = rng.uniform(-1.0, 1.0, 3)
        turned = Pose.at(0.0, 0.0, 0.0, yaw=turn * self.angle)
        moved = pose.translated(x * self.distance, y * self.distance)
        return Pose(moved.position, (turned * Pose(quaternion=pose.quaternion)).quaternion)


@dataclass
class Outcome:
    """Score of a repetition.

    Attributes:
        metrics: value of each of the task's metrics; None where there is none.
        details: whatever explains the score, as plain data.
        reading: of a law.
        wait: for the count, if that may be short.
        reasons: why the score is no better, one short text for each thing that went wrong; reports
            count them.
    """

    metrics: dict[str, float | None] = field(default_factory=dict)
    details: dict[str, Any] = field(default_factory=dict)
    reading: Reading | None = None
    wait: Wait | None = None
    reasons: tuple[str, ...] = ()


Count = Callable[[int, int], None]
"""Progress: called with how many are done, and of how many; `Task.counted` says what."""


class Task(ABC):
    """A task. Subclasses are frozen dataclasses whose fields are the task's parameters.

    Attributes:
        name: in records and tables.
        metrics: what it measures.
        study_timeout: the reference study's time-out from launch, real time [s].
        references: metric name to the value of a perfect simulator, where there is one.
        counted: what progress counts: "cubes placed" shows as `4/15 cubes placed`.
        moments: where replays save and restore, and until which a disturbance is followed.
        draws: whether seed and jitter change anything but which start it is. If not, a simulator
            that is deterministic does it once, however many repetitions are asked for.
        shares_worker: it takes less time than the start of a worker, so one serves several tests.
        pictured: phases within which the task notes moments (`World.note`); pictures show them.
    """

    name: ClassVar[str]
    study_timeout: ClassVar[float] = 600.0
    references: ClassVar[Mapping[str, float]] = {}
    counted: ClassVar[str] = ""
    moments: ClassVar[tuple[Moment, ...]] = ()
    draws: ClassVar[bool] = True
    shares_worker: ClassVar[bool] = False
    pictured: ClassVar[tuple[str, ...]] = ()

    @property
    @abstractmethod
    def metrics(self) -> tuple[Metric, ...]:
        """What it measures, the study's metrics first."""

    @property
    def repetitions(self) -> int | None:
        """How many there are to be where nobody says; None: as many as the protocol has."""
        return None

    @property
    def different(self) -> int | None:
        """How many a simulator that is deterministic does before one is the copy of another; None:
        each seed is another."""
        return None if self.draws else 1

    def sample(self, seed: int) -> tuple[str, int] | None:
        """The data set and the number in it of the measured motion that the repetition of a seed is
        held against, if it is."""
        return None

    @property
    def scale(self) -> float:
        """All lengths of the scene over those for an arm of full size, as the study's."""
        return 1.0

    def smoke(self) -> Task:
        """The smallest version of the task that still exercises every part of it."""
        return self

    def study(self) -> Task:
        """The task by the reference study's own rules, where they differ from ours; docs/study.md
        lists each difference. Its size stays as asked for. Every rule is a parameter, so that
        the record says which one held."""
        return self

    def on(self, robot: Robot) -> Task:
        """The task as another robot does it: its field `robot` replaced.

        Raises:
            RobotError: it takes none; one sentence.
        """
        if ROBOT in {item.name for item in fields(self)}:  # type: ignore[arg-type]
            return replace(self, **{ROBOT: robot})  # type: ignore[type-var]
        if self.scene(0, Jitter(0.0, 0.0)).robot is None:
            return self
        raise RobotError(
            f"the task {self.name!r} takes no other robot than its own: give it a field "
            f"`{ROBOT}: Robot | None = None`, and use that robot in its scene"
        )

    def problem(self) -> str | None:
        """What the robot cannot do of the task, in one sentence, or None. Asked before anything
        runs, of a robot that was chosen."""
        return None

    def parameters(self) -> dict[str, Any]:
        """Every parameter under its name in records: `task.levels`, `task.speeds.carry`. The robot
        is a part of the record by itself."""
        names = [item.name for item in fields(self) if item.name != ROBOT]  # type: ignore[arg-type]
        values = {name: recorded(getattr(self, name)) for name in names}
        scaled = {} if self.scale == 1.0 else {"task.scale": self.scale}
        return {**dict(_flat("task", values)), **scaled}

    @abstractmethod
    def scene(self, seed: int, jitter: Jitter) -> Scene:
        """The scene of a repetition; the same seed gives the same scene on every simulator."""

    @abstractmethod
    def perform(self, world: World, seed: int, count: Count) -> Outcome:
        """Carry out the task in a freshly loaded world, wait for things to settle, score.

        Enter a phase (`world.phase`) for every stage, and measure what is planning
        with `world.stopwatch.measuring("plan")`.
        """

    def change(self, before: Outcome, after: Outcome) -> str:
        """What became of an outcome, in words that no metric has ("topples tower 2"), or ""."""
        return ""


def _flat(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _flat(f"{name}.{key}", item)
    else:
        yield name, value


def cube(
    name: str, pose: Pose, colour: tuple[float, float, float, float], scale: float = 1.0
) -> Box:
    """One of the study's cubes, its edge times `scale`, of the same density."""
    return Box(name, (CUBE_SIZE * scale,) * 3, pose, mass=CUBE_MASS * scale**3, colour=colour)


def scaled(place: Vector3, scale: float) -> Pose:
    """A place of the study's scene [m] in one of another size."""
    x, y, z = place
    return Pose.at(x * scale, y * scale, z * scale)


def distance(a: Pose, b: Pose) -> float:
    """Between two positions [m]."""
    return float(np.linalg.norm(np.subtract(a.position, b.position)))


def aside(a: Pose, b: Pose) -> float:
    """How far one is from the other as the study counts: in x or in y, whichever is more [m]."""
    return float(np.abs(np.subtract(b.position, a.position))[:2].max())


class Randomness(NamedTuple):
    """Independent random generators of a repetition, one for each thing that chance decides: the
    disturbance of the start, the order of the cubes, whatever the planner draws."""

    start: np.random.Generator
    order: np.random.Generator
    planner: np.random.Generator

    @classmethod
    def of(cls, seed: int) -> Randomness:
        """Those of a repetition's seed."""
        return cls(*map(np.random.default_rng, np.random.SeedSequence(seed).spawn(3)))


@dataclass(frozen=True)
class Moment:
    """A moment of a task.

    Attributes:
        name: for tables.
        phase: of the task.
        operation: number of the operation in that phase before which it is, from 0.
    """

    name: str
    phase: str
    operation: int = 0

    def place(self, tape: Tape) -> int | None:
        """Number of the operation of a tape before which it is; None: there is none."""
        numbers = [k for k, operation in enumerate(tape) if operation.phase == self.phase]
        return numbers[self.operation] if self.operation < len(numbers) else None
