"""The adapter under test: its settings, and worlds of it in a real worker process."""

from __future__ import annotations

import atexit
import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from pytest_simbench.client.answers import Constructed
from pytest_simbench.client.environments import Environment, interpreter
from pytest_simbench.client.errors import BadState, Diverged, Where, WorkerError
from pytest_simbench.client.launch import Launch
from pytest_simbench.client.motion import Motion
from pytest_simbench.client.process import WorkerProcess
from pytest_simbench.client.world import World
from pytest_simbench.description.urdf import ROOT
from pytest_simbench.laws import Law
from pytest_simbench.motion.panda import panda
from pytest_simbench.scene import Robot, Scene
from pytest_simbench.simulator import Capability, Settings, Simulator
from pytest_simbench.simulator.settings import profile


class ConformanceFailure(AssertionError):
    """A simulator breaks one of the kit's laws."""


def require(holds: object, message: str) -> None:
    """Raise `ConformanceFailure` with the message unless the law holds."""
    if not holds:
        raise ConformanceFailure(message)


def require_close(what: str, value: float, expected: float, tolerance: float, unit: str) -> None:
    """Raise `ConformanceFailure` unless |value - expected| <= tolerance; all three are told."""
    unit = f" {unit}" if unit else ""
    require(
        abs(value - expected) <= tolerance,
        f"{what} is {value:.6g}{unit}, expected {expected:.6g} within {tolerance:.3g}{unit}",
    )


TIMEOUT = 120.0
"""For anything but compiling [s]."""

_shared: dict[tuple[str | None, str, str], WorkerProcess] = {}
"""By interpreter, the adapter's top package (all that a worker can import of it), and name."""


@dataclass(frozen=True)
class Subject:
    """One adapter with one settings profile, and a robot.

    Checks share one worker process per interpreter, in which every world is constructed anew, as
    the plugin does for engines that start slowly; a check that fails in the engine costs only
    that process.

    Attributes:
        cls: the adapter's class.
        python: interpreter of its worker; None for that of its own environment where it has one
            (`simbench install`), else this one.
        robot: that the laws are asked with; None: the Panda.
    """

    cls: type[Simulator]
    profile: str = "tuned"
    python: str | None = None
    robot: Robot | None = None

    @property
    def adapter(self) -> str:
        return f"{self.cls.__module__}:{self.cls.__qualname__}"

    @property
    def name(self) -> str:
        return self.cls.info.name

    @property
    def settings(self) -> Settings:
        return profile(self.cls.profiles, self.profile, self.name)

    @property
    def timestep(self) -> float:
        """[s]."""
        return self.settings.timestep

    @property
    def arm(self) -> Robot:
        """The robot that the laws are asked with."""
        return self.robot or panda()

    def can(self, capability: Capability) -> bool:
        return capability in self.cls.info.capabilities

    def excused(self, quantity: str) -> str | None:
        """Why the adapter does not tell or have a quantity, as it declares; None: it does."""
        return next((d.reason for d in self.cls.info.deviations if d.excuses(quantity)), None)

    def can_build(self, scene: Scene) -> None:
        """Skip the law when the scene has a robot and the adapter declares that it has none: as a
        deviation of every link, `Deviation("link/*", "mysim has no robots")`."""
        if scene.robot is not None:
            lacking = [d for d in self.cls.info.deviations if d.within is None]
            reason = next((d.reason for d in lacking if d.excuses(f"link/{ROOT}/pose")), None)
            if reason is not None:
                pytest.skip(reason)

    def launch(self, *, gui: bool = False) -> WorkerProcess:
        """A worker process of its own; the caller closes it."""
        handle, log = tempfile.mkstemp(prefix=f"{self.name}-", suffix=".log")
        os.close(handle)
        atexit.register(Path(log).unlink, missing_ok=True)
        info = self.cls.info
        launch = Launch(
            self.adapter,
            python=self.python or interpreter(info),
            environment=Environment.of(info).variables(),
            log=Path(log),
            stall_timeout=TIMEOUT,
            compile_timeout=info.compile_timeout if info.costly_start else 0.0,
        )
        return WorkerProcess(launch, Where(self.name, "gui" if gui else "headless"))

    def shared(self) -> WorkerProcess:
        """The process that checks share; started when first needed."""
        key = (self.python, self.adapter.partition(".")[0], self.name)
        if key not in _shared or not _shared[key].alive:
            _shared[key] = self.launch()
        return _shared[key]

    def construct(
        self, process: WorkerProcess, changes: Mapping[str, Any] | None = None, gui: bool = False
    ) -> Constructed:
        """Have the process make the simulator, whichever one the process was started for."""
        return process.construct(
            self.profile, changes, gui=gui, adapter=self.adapter, timeout=TIMEOUT
        )

    @contextmanager
    def world(
        self,
        scene: Scene,
        *,
        fresh: bool = False,
        gui: bool = False,
        changes: Mapping[str, Any] | None = None,
        parity: bool = True,
    ) -> Iterator[World]:
        """A world of `scene`, checked if `parity`; in a process of its own if `fresh` or `gui`."""
        self.can_build(scene)
        alone = fresh or gui
        process = self.launch(gui=gui) if alone else self.shared()
        try:
            self.construct(process, changes, gui)
            yield World(process, scene, parity=parity)
        except WorkerError as error:
            process.kill()
            if isinstance(error, Diverged | BadState):  # a law is broken, whichever is looked at
                raise ConformanceFailure(error.what) from error
            raise
        finally:
            if alone:
                process.close()

    def motion(self, scene: Scene, seconds: float, log_period: float) -> Motion:
        """What happens by itself in `scene`."""
        with self.world(scene) as world:
            return world.wait(seconds, log_period=log_period)


def asked(subject: Subject, *laws: Law, within: float | None = None) -> None:
    """Ask laws of `pytest_simbench.laws`, each in a world of its own; `within` their own
    tolerances, or a bound [in the law's unit].

    Raises:
        ConformanceFailure: the reading of one is farther off.
    """
    for law in laws:
        with subject.world(law.build()) as world:
            found = law.measure(world)
        limit = found.tolerance if within is None else within
        require_close(f"{law.name}: {law.quantity}", found.value, found.exact, limit, law.unit)


def close_workers() -> None:
    """End the processes that checks shared."""
    while _shared:
        _, process = _shared.popitem()
        if process.alive:
            process.close()


atexit.register(close_workers)
