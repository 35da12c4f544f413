"""Adapters that misbehave on purpose: a real engine, with one fault each.

They are loaded by workers as `tests.client.faulty:ENGINE_FAULT`, `MuJoCo_Killed` for instance.
"""

from __future__ import annotations

import ctypes
import os
import signal
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from pytest_simbench.sims.mujoco.adapter import MuJoCo
from pytest_simbench.sims.pybullet.adapter import PyBullet

from pytest_simbench.scene import Scene
from pytest_simbench.simulator import Simulator

FAULT_TIME = 0.3
"""Simulated time at which the fault happens [s]."""


def _spoil_mujoco(simulator: Any) -> None:
    simulator.data.qpos[:] = np.nan


def _spoil_pybullet(simulator: Any) -> None:
    import pybullet

    for body in simulator._free:
        pybullet.resetBaseVelocity(body, [np.nan] * 3, physicsClientId=simulator.client)


def _heavier_mujoco(simulator: Any) -> None:
    simulator.model.opt.gravity[2] = -20.0


def _heavier_pybullet(simulator: Any) -> None:
    import pybullet

    pybullet.setGravity(0, 0, -20.0, physicsClientId=simulator.client)


ENGINES: dict[str, type[Simulator]] = {"MuJoCo": MuJoCo, "PyBullet": PyBullet}
SPOIL: dict[str, Callable[[Any], None]] = {"mujoco": _spoil_mujoco, "pybullet": _spoil_pybullet}
HEAVIER = {"mujoco": _heavier_mujoco, "pybullet": _heavier_pybullet}


class Blind(MuJoCo):
    """Draws nothing."""

    def render(self, width: int, height: int) -> Any:
        raise self._missing("offscreen picture")


class Faulty(Simulator):
    """Does `fault` once its time has come."""

    def step(self) -> None:
        super().step()  # type: ignore[safe-super]  # the engine comes next in the method order
        if self.time >= FAULT_TIME:
            self.fault()

    def fault(self) -> None:
        raise NotImplementedError


class Killed(Faulty):
    def fault(self) -> None:
        os.kill(os.getpid(), signal.SIGKILL)


class Crashed(Faulty):
    def fault(self) -> None:
        ctypes.string_at(0)  # reads address 0: a true segmentation fault


class Stopped(Faulty):
    def fault(self) -> None:
        os.kill(os.getpid(), signal.SIGSTOP)


class Hung(Faulty):
    """Hangs in C code that holds the GIL, so that no other thread of the worker runs either."""

    def fault(self) -> None:
        ctypes.PyDLL(None).sleep(600)


class Raising(Faulty):
    def fault(self) -> None:
        raise ValueError("the engine is unhappy")


class NotANumber(Faulty):
    def fault(self) -> None:
        SPOIL[self.info.name](self)


class Greedy(Faulty):
    """Takes 20 MB more at every step."""

    def fault(self) -> None:
        self.__dict__.setdefault("hoard", []).append(np.ones(2_500_000))
        time.sleep(0.01)


class Chatty(Simulator):
    """Writes garbage to the real stdout, where execnet's messages would go."""

    def step(self) -> None:
        super().step()  # type: ignore[safe-super]
        os.write(1, b"\xff\x00garbage\n")


class CrashesClosing(Simulator):
    def close(self) -> None:
        os.kill(os.getpid(), signal.SIGSEGV)


class WrongGravity(Simulator):
    def load(self, scene: Scene) -> None:
        super().load(scene)  # type: ignore[safe-super]
        HEAVIER[self.info.name](self)


COMPILE_SECONDS = 1.5


class Costly(Simulator):
    """Takes a while to compile, once per process, and is therefore used for many repetitions."""

    compiled = 0

    def compile(self, scene: Scene) -> None:
        if not Costly.compiled:
            time.sleep(COMPILE_SECONDS)
        Costly.compiled += 1


class NeverCompiled(Simulator):
    def compile(self, scene: Scene) -> None:
        time.sleep(600)


class Restless(Simulator):
    """Does not put the clock back when it loads again."""

    def load(self, scene: Scene) -> None:
        super().load(scene)  # type: ignore[safe-super]
        Restless.loads += 1
        for _ in range(Restless.loads - 1):
            self.step()

    loads = 0


FAULTS: tuple[type[Simulator], ...] = (
    Killed, Crashed, Stopped, Hung, Raising, NotANumber, Greedy, Chatty, CrashesClosing,
    WrongGravity, Costly, NeverCompiled, Restless,
)  # fmt: skip


def __getattr__(name: str) -> type[Simulator]:
    engine, _, fault = name.partition("_")
    for made in FAULTS:
        if engine in ENGINES and made.__name__ == fault:
            cls = ENGINES[engine]
            info = replace(cls.info, costly_start=fault in ("Costly", "NeverCompiled", "Restless"))
            return type(name, (made, cls), {"info": info})
    raise AttributeError(name)
