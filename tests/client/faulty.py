"""Adapters that misbehave on purpose: the real MuJoCo, with one fault each.

They are loaded by workers as `tests.client.faulty:NAME`.
"""

from __future__ import annotations

import ctypes
import os
import signal
import time

import numpy as np
from pytest_simbench.sims.mujoco import MuJoCo

from pytest_simbench.scene import Scene

FAULT_TIME = 0.3
"""Simulated time at which the fault happens [s]."""


class Faulty(MuJoCo):
    """Does `fault` once when its time has come."""

    def step(self) -> None:
        super().step()
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
        self.data.qpos[:] = np.nan


class Greedy(Faulty):
    """Takes 20 MB more at every step."""

    def fault(self) -> None:
        self.__dict__.setdefault("hoard", []).append(np.ones(2_500_000))
        time.sleep(0.01)


class Chatty(MuJoCo):
    """Writes garbage to the real stdout, where execnet's messages would go."""

    def step(self) -> None:
        super().step()
        os.write(1, b"\xff\x00garbage\n")


class CrashesClosing(MuJoCo):
    def close(self) -> None:
        os.kill(os.getpid(), signal.SIGSEGV)


class WrongGravity(MuJoCo):
    def load(self, scene: Scene) -> None:
        super().load(scene)
        self.model.opt.gravity[2] = -20.0
