"""A simulator for interactive tests: one worker, many worlds."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import count
from typing import Any

from pytest_simbench.client.answers import Constructed
from pytest_simbench.client.errors import DisplayError, DisplayLost, Where, WorkerError
from pytest_simbench.client.process import WorkerProcess
from pytest_simbench.client.tape import Operation, TapedWorld
from pytest_simbench.experiment.case import Case
from pytest_simbench.experiment.example import replay_command, write_example
from pytest_simbench.records.series import short
from pytest_simbench.scene import Scene

EPISODE_TIMEOUT = 3600.0
"""Wall time of an episode [s], unless `--sim-timeout` gives another; silence ends it sooner."""

_numbers = count(1)
"""Of the workers that handles of this process started: their logs have names of their own."""


class SimulatorHandle:
    """Starts worlds of one simulator. Its worker is reused between episodes, each of which builds
    the simulator and the scene anew; a worker that died is replaced.

    Safe in a Hypothesis test: a crash inside an example is an ordinary exception of that
    example, and the next one gets a fresh worker. What was done to the world of a failing
    example is written to a file, and a note on the exception says how to replay it.

    Attributes:
        constructed: the simulator that the worker made last.
        tape: of the last episode, see `TapedWorld`.
    """

    def __init__(self, case: Case) -> None:
        self.case = case
        self.constructed = Constructed()
        self.tape: list[Operation] = []
        self._process: WorkerProcess | None = None
        self._open = False

    @contextmanager
    def episode(self, scene: Scene, **options: Any) -> Iterator[TapedWorld]:
        """A freshly loaded world, for as long as the `with` block lasts.

        Args:
            options: of `TapedWorld`: a tape to be played, a period of samples; `parity`: whether
                to check that the engine built this scene.

        Raises:
            WorkerError: of whatever kind happens to the worker.
            RuntimeError: another episode is still open; they share one worker.
        """
        if self._open:
            raise RuntimeError(
                f"an episode of {self.case.simulator} is still open, and there is one worker: "
                "leave its `with` block first"
            )
        self._open = True
        self.tape = []
        try:
            world = self.world(scene, **options)
            self.tape = world.tape
            yield world
        except BaseException as error:
            if isinstance(error, WorkerError) or (self._process and self._process.busy):
                self.close()  # dead, or with an answer under way that nobody waits for
            given_up = type(error).__module__.startswith("hypothesis.")  # as `assume` does
            if isinstance(error, Exception) and not given_up:
                self._keep_example(error, scene)
            raise
        finally:
            self._open = False

    def world(self, scene: Scene, **options: Any) -> TapedWorld:
        """A freshly loaded world, in place of the one before; arguments and errors as `episode`."""
        case = self.case
        if self._process is None or not self._process.alive:
            # The process id keeps the workers of pytest-xdist apart, which share a run folder.
            name = f"{case.short_name}-{case.simulator}-{os.getpid()}-{next(_numbers)}"
            where = Where(case.simulator, case.mode)
            try:
                self._process = WorkerProcess(case.launch(name), where)
            except DisplayError as error:
                raise DisplayLost(str(error), where) from None
        self._process.deadline = time.monotonic() + (case.timeout or EPISODE_TIMEOUT)
        self.constructed = self._process.construct(case.base, case.changes, gui=case.mode == "gui")
        return TapedWorld(self._process, scene, **options)

    def _keep_example(self, error: Exception, scene: Scene) -> None:
        """Write the failing episode to the run folder."""
        case = self.case
        test = os.environ.get("PYTEST_CURRENT_TEST", case.short_name).rpartition(" ")[0]
        name = f"{short(test) or 'episode'}-{case.simulator}-{case.mode}"
        with suppress(OSError):  # a full disk must not hide the failure itself
            path = write_example(case, name, scene, self.tape, self.constructed.versions)
            error.add_note(f"replay this episode: {replay_command(path, case, scene)}")

    def close(self) -> None:
        """End the worker, if there is one; also from another thread than the one that uses it."""
        process, self._process = self._process, None
        if process is not None:
            if process.busy:
                process.kill()
            with suppress(WorkerError):
                process.close(timeout=5.0)
