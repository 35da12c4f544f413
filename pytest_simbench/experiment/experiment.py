"""An experiment: a task in a case, that is what all repetitions of a test have in common."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from pytest_simbench.experiment.case import Case
from pytest_simbench.motion.errors import RobotError
from pytest_simbench.scene import Robot, Scene, SceneError
from pytest_simbench.tasks.base import ROBOT, Jitter, Task


class JitterError(Exception):
    """Starts that cannot be, since the jitter is too large; the message is one sentence."""


@dataclass(frozen=True)
class Experiment:
    """A task in a case. A test asks for the task; the protocol may want another version of it.

    Attributes:
        asked: the task that the test asks for.
    """

    case: Case
    asked: Task

    @cached_property
    def task(self) -> Task:
        """The version of the task that the protocol wants, done by the case's robot. Nobody else
        asks the protocol: a version of a version would be another one.

        Raises:
            RobotError: the task takes no other robot than its own.
        """
        version, robot = self.case.protocol.version_of(self.asked), self.case.robot
        return version if robot is None else version.on(robot)

    @property
    def robot(self) -> Robot | None:
        """The robot that was chosen, if the task has one."""
        return self.case.robot if ROBOT in vars(self.task) else None

    def problem(self) -> str | None:
        """What the case's robot cannot do of the task, in one sentence, or None."""
        if self.case.robot is None:
            return None
        try:
            return self.task.problem()
        except RobotError as error:
            return str(error)

    def in_case(self, **changes: Any) -> Experiment:
        """The same task in a changed case."""
        return replace(self, case=replace(self.case, **changes))

    def seed(self, number: int = 1) -> int:
        """Of a repetition, counted from 1."""
        return self.case.seed + number - 1

    @property
    def sole(self) -> bool:
        """Whether one repetition is all there is: others would be the same."""
        return self.most == 1

    @property
    def most(self) -> int | None:
        """How many there can be before one is the copy of another; None where chance makes each
        another."""
        return self.task.different if self.case.deterministic else None

    def repetitions(self, asked: int | None) -> int:
        """How many there are to be: what is asked for, else what the task or the protocol has; none
        that would be a copy."""
        number = asked or self.task.repetitions or self.case.protocol.repetitions
        return min(number, self.most or number)

    def scene(self, seed: int) -> Scene:
        """The world that the task begins with, its cubes disturbed as `--jitter` has it."""
        one, scale = Jitter(), self.case.jitter
        found: object = self.task.scene(seed, Jitter(one.distance * scale, one.angle * scale))
        if not isinstance(found, Scene):
            raise TypeError(f"scene() returns a Scene, not {type(found).__name__}")
        return found

    def check_jitter(self, numbers: Iterable[int]) -> None:
        """Complain of a jitter above the usual one with which these repetitions cannot start.

        Raises:
            JitterError: bodies of one overlap, or leave the room.
        """
        for seed in map(self.seed, numbers) if self.case.jitter > 1 else ():
            try:
                self.scene(seed)
            except SceneError as error:
                self.task.scene(seed, Jitter(0.0, 0.0))  # raises what is no fault of the jitter
                raise JitterError(
                    f"the jitter {self.case.jitter:g} is too large for the task "
                    f"{self.task.name!r}: seed {seed}: {str(error).partition(';')[0]}; give a "
                    "smaller one"
                ) from None

    @property
    def reuses_worker(self) -> bool:
        """Whether one worker serves several repetitions."""
        return (self.case.costly_start or self.task.shares_worker) and not self.case.fresh

    @property
    def timeout(self) -> float:
        """Of a repetition from launch [s]."""
        return float(self.case.timeout or self.task.study_timeout)

    @property
    def limits(self) -> dict[str, float | None]:
        """Time-outs [s] and the limit of memory [MB]."""
        return {
            "timeout": self.timeout,
            "stall_timeout": self.case.stall_timeout,
            "memory_limit": self.case.memory_limit,
        }
