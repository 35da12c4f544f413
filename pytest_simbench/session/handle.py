"""A simulator for interactive tests: one worker, many worlds."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from pytest_simbench.client.errors import Where, WorkerError
from pytest_simbench.client.process import WorkerProcess
from pytest_simbench.client.world import World
from pytest_simbench.scene import Scene
from pytest_simbench.session.case import Case


class SimulatorHandle:
    """Starts worlds of one simulator. Its worker is reused between episodes, each of which builds
    the simulator and the scene anew; a worker that died is replaced.

    Safe in a Hypothesis test: a crash inside an example is an ordinary exception of that
    example, and the next one gets a fresh worker.
    """

    def __init__(self, case: Case) -> None:
        self.case = case
        self._process: WorkerProcess | None = None
        self._started = 0

    @contextmanager
    def episode(self, scene: Scene, *, parity: bool = True) -> Iterator[World]:
        """A freshly loaded world.

        Raises:
            WorkerError: of whatever kind happens to the worker.
        """
        try:
            yield self._start(scene, parity)
        except WorkerError:
            self.close()
            raise

    @contextmanager
    def episodes(self) -> Iterator[Callable[[Scene], World]]:
        """A function that starts worlds, one at a time."""
        yield lambda scene: self._start(scene, True)

    def _start(self, scene: Scene, parity: bool) -> World:
        case = self.case
        if self._process is None or not self._process.alive:
            self._started += 1
            # The process id keeps the workers of pytest-xdist apart, which share a run folder.
            name = f"{case.short_name}-{case.simulator}-{os.getpid()}-{self._started}"
            self._process = WorkerProcess(case.launch(name), Where(case.simulator, case.mode))
        self._process.request(
            "construct",
            timeout=case.stall_timeout,
            adapter=case.adapter,
            profile=case.profile,
            changes=dict(case.changes),
            gui=case.mode == "gui",
            real_time=False,
        )
        return World(self._process, scene, parity=parity)

    def close(self) -> None:
        """End the worker, if there is one."""
        if self._process is not None:
            with suppress(WorkerError):
                self._process.close(timeout=5.0)
            self._process = None
