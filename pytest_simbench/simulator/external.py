"""The base of an adapter whose simulator is a program of its own, stepped in lock-step.

What it would take for the programs that the study compared is in docs/external.md.
"""

from __future__ import annotations

import tempfile
from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import ClassVar

from pytest_simbench.scene import Scene
from pytest_simbench.simulator.base import Simulator
from pytest_simbench.simulator.errors import SimulatorError
from pytest_simbench.simulator.program import Program


class ExternalSimulator(Simulator):
    """Base of an adapter of a program that simulates in lock-step.

    The life of the program: `command_line` and `variables` start it in a folder of its own, it is
    waited for until `connect` succeeds, `build` has it build the world, and `ask_to_end` is its
    last call. Each is bounded in time; a program that dies or hangs gives an error with its last
    words. Calls of the program elsewhere (`command`, `body_state`) go into `with self.asking(...)`.

    `step` is `advance(1)`, and `advance` is the barrier: it returns when the program has made so
    many steps, by its own count, and no others.

    Attributes:
        program: that runs; None before `load`.
        folder: the program's, for the world's files.
        scene: that was loaded.
        steps: made since `load`.
        start_limit, answer_limit, end_limit: wall time for starting and for building the world,
            for any other call, and for ending [s]. The first two are less than the 60 s of silence
            after which the client kills a worker: so the message is the program's own.
    """

    start_limit: ClassVar[float] = 50.0
    answer_limit: ClassVar[float] = 30.0
    end_limit: ClassVar[float] = 5.0

    program: Program | None = None
    _folder: tempfile.TemporaryDirectory[str] | None = None

    @abstractmethod
    def command_line(self) -> Sequence[str]:
        """The program and its arguments; `scene` and `folder` are known."""

    def variables(self) -> Mapping[str, str]:
        """Of the program's environment, beside the worker's."""
        return {}

    @abstractmethod
    def connect(self) -> bool:
        """Whether the program answers by now; called until it does. It is no error that nobody
        listens yet."""

    @abstractmethod
    def build(self, scene: Scene) -> None:
        """Have the program build the world, at time 0.

        Raises:
            SimulatorError: it refuses the world; the message has its own words.
        """

    @abstractmethod
    def make_steps(self, steps: int) -> int:
        """Have the program make so many steps, and return when they are made.

        Returns:
            The number of steps since `build`, by the program's own count or clock.
        """

    @abstractmethod
    def ask_to_end(self) -> None:
        """Ask the program to end; it is killed if it does not."""

    def load(self, scene: Scene) -> None:
        self.scene, self.steps = scene, 0
        self._folder = tempfile.TemporaryDirectory(
            prefix=f"simbench-{self.info.name}-", ignore_cleanup_errors=True
        )
        self.folder = Path(self._folder.name)
        self.program = program = Program(
            self.info.title, self.command_line(), self.folder, self.variables()
        )
        program.wait_until(self.connect, self.start_limit)
        with program.within(self.start_limit, "building the world"):
            self.build(scene)

    @contextmanager
    def asking(self, doing: str) -> Iterator[None]:
        """Within `answer_limit`; see `Program.within`.

        Raises:
            SimulatorError: as there, or nothing was loaded.
        """
        if self.program is None:
            raise SimulatorError(f"{self.info.title} was not started: no scene was loaded")
        with self.program.within(self.answer_limit, doing):
            yield

    def advance(self, steps: int) -> None:
        """Advance by exactly so many time steps.

        Raises:
            SimulatorError: another number of steps has passed since `load`.
        """
        with self.asking("stepping"):
            passed = self.make_steps(steps)
        self.steps += steps
        if passed != self.steps:
            raise SimulatorError(
                f"{self.info.title} has made {passed} steps and should have made {self.steps}: "
                "its time moves by itself or in other steps, so it is not in lock-step"
            )

    def step(self) -> None:
        self.advance(1)

    @property
    def time(self) -> float:
        return self.steps * self.settings.timestep

    def close(self) -> None:
        if self.program is not None:
            self.program.end(self.ask_to_end, self.end_limit)
        if self._folder is not None:
            self._folder.cleanup()
