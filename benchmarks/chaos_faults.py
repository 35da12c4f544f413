"""The faults of chaos.py, and the real adapters, each with a fault that waits for its moment.

Imported in workers as `chaos_faults:ENGINE`. The fault's name stands in the environment as CHAOS,
the simulated time of its moment [s] as CHAOS_AT.
"""

from __future__ import annotations

import ctypes
import os
import resource
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from signal import SIGBUS, SIGKILL, SIGSEGV, SIGSTOP, SIGTERM, raise_signal
from typing import Any

import numpy as np

from pytest_simbench.scene import FloatArray
from pytest_simbench.simulator import Simulator
from pytest_simbench.simulator.registry import registered

ENGINES = ("mujoco", "pybullet", "sapien", "dart")

AT = float(os.environ.get("CHAOS_AT", 0.0))


@dataclass(frozen=True)
class Fault:
    """What happens, and what the record must say.

    Attributes:
        cause: type of the record's error, and a part of its message; nothing where all is well.
        do: what happens; of a state or a time: what becomes of the value.
        when: `step` once at the moment; `state` and `time` from the moment on; `every step`;
            `later` from a thread, just after the world was loaded; `run` see chaos.py.
    """

    cause: tuple[str, str] = ("", "")
    do: Callable[..., Any] = lambda: None
    when: str = "step"

    @property
    def status(self) -> str:
        return {"": "ok", "KeyboardInterrupt": "interrupted"}.get(self.cause[0], "failed")


def on_pipes(act: Callable[[int], Any]) -> Callable[[], None]:
    """Does something to each of execnet's descriptors, and hangs."""

    def fault() -> None:
        for name in os.listdir("/proc/self/fd"):
            with suppress(OSError):  # also of writing where one reads
                if int(name) > 2 and os.readlink(f"/proc/self/fd/{name}").startswith("pipe:"):
                    act(int(name))
        time.sleep(600)

    return fault


def eat() -> None:
    """Memory up to the limit, at 10 MB a moment."""
    hoard = []
    while True:
        hoard.append(np.ones(1_250_000))
        time.sleep(0.02)


def eat_at_once() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (2**41, resource.getrlimit(resource.RLIMIT_AS)[1]))
    np.ones(2**42)


def raises(error: BaseException) -> None:
    raise error


def without_disk() -> None:
    """Every line of the log is one too many."""
    full = os.open("/dev/full", os.O_WRONLY)
    for descriptor, stream in ((1, sys.stdout), (2, sys.stderr)):
        os.dup2(full, descriptor)
        print("lost", file=stream, flush=True)


def without_folder() -> None:
    folder = tempfile.mkdtemp()
    os.chdir(folder)
    os.rmdir(folder)


def child(number: int | None = None, wait: bool = False) -> Callable[[], None]:
    """A child that gets a signal, and may be waited for, as by an engine with a server."""

    def fault() -> None:
        started = subprocess.Popen(SLEEPER)
        if number is not None:
            started.send_signal(number)
        if wait and started.wait():
            raise subprocess.CalledProcessError(started.returncode, "engine")

    return fault


SLEEPER = [sys.executable, "-c", "import time; time.sleep(600)"]

STOP, HANG = partial(raise_signal, SIGSTOP), partial(time.sleep, 600)
KEEP = partial(ctypes.PyDLL(None).sleep, 600)
"""Keeps the interpreter: no other thread of this process runs any more."""

HALF = b"\4\0\0\0\1\0\0\3\350half"
"""What begins a message of 1000 bytes."""

EXITED, FAILED, BAD = "WorkerExited", "EngineFailed", "BadState"
HUNG, OK = ("WorkerHung", "no sign of life"), ("", "")
BROKEN, CTRL_C = (EXITED, "broke the connection"), ("KeyboardInterrupt", "")
TIME, FORKS = (BAD, "the time must be"), ("ProtocolError", "engine forks")

FAULTS = {
    "none": Fault(),
    "SIGSEGV": Fault((EXITED, "SIGSEGV"), lambda: ctypes.string_at(0)),
    "SIGABRT": Fault((EXITED, "SIGABRT"), os.abort),
    "SIGKILL": Fault((EXITED, "SIGKILL"), partial(raise_signal, SIGKILL)),
    "SIGBUS": Fault((EXITED, "SIGBUS"), partial(raise_signal, SIGBUS)),
    "SIGTERM of the worker": Fault((EXITED, "SIGTERM"), partial(raise_signal, SIGTERM)),
    "SIGSTOP while stepping": Fault(HUNG, STOP),
    "SIGSTOP between requests": Fault(HUNG, STOP, "later"),
    "interpreter kept between requests": Fault(HUNG, KEEP, "later"),
    "hang, interpreter kept": Fault(HUNG, KEEP),
    "hang, interpreter free": Fault(HUNG, HANG),
    "garbage on stdout": Fault(OK, lambda: os.write(1, os.urandom(100_000))),
    "garbage among the messages": Fault(BROKEN, on_pipes(lambda to: os.write(to, b"c" + bytes(8)))),
    "half a message": Fault(HUNG, on_pipes(lambda to: os.write(to, HALF))),
    "connection closed": Fault(BROKEN, on_pipes(os.close)),
    "sys.exit": Fault((EXITED, "sys.exit(4)"), lambda: sys.exit(4)),
    "os._exit": Fault((EXITED, "status 5"), lambda: os._exit(5)),
    "exception while stepping": Fault((FAILED, "unhappy"), lambda: raises(ValueError("unhappy"))),
    "base exception": Fault((FAILED, "inside"), lambda: raises(KeyboardInterrupt("inside"))),
    "endless recursion": Fault(
        (FAILED, "RecursionError"), lambda: FAULTS["endless recursion"].do()
    ),
    "state not a number": Fault(("Diverged", "not finite"), lambda b: b * np.nan, "state"),
    "state of nothing": Fault((BAD, "float64"), lambda b: None, "state"),
    "time not a number": Fault(TIME, lambda t: np.nan, "time"),
    "time stands still": Fault(TIME, lambda t: AT, "time"),
    "time runs back": Fault(TIME, lambda t: 2 * AT - t, "time"),
    "time jumps": Fault(TIME, lambda t: t + 100.0, "time"),
    "fork that answers": Fault(FORKS, lambda: os.fork() and time.sleep(1.0)),  # the child is first
    "memory up to the limit": Fault(("OutOfMemory", "--sim-memory-limit"), eat),
    "memory refused": Fault(("OutOfMemory", "allocate"), eat_at_once),
    "slow": Fault(("RepetitionTimeout", "--sim-timeout"), lambda: time.sleep(0.02), "every step"),
    "child left behind": Fault(OK, child()),
    "child stopped, left behind": Fault(OK, child(SIGSTOP)),
    "child stopped, waited for": Fault(HUNG, child(SIGSTOP, wait=True)),
    "SIGSEGV of a child": Fault((FAILED, "SIGSEGV"), child(SIGSEGV, wait=True)),
    "daemon left behind": Fault(OK, partial(subprocess.run, ["setsid", "--fork", *SLEEPER])),
    "full disk for the log": Fault(OK, without_disk),
    "log deleted": Fault(OK, lambda: os.unlink(os.readlink("/proc/self/fd/1"))),
    "folder deleted": Fault(OK, without_folder),
    "log flooded": Fault(OK, lambda: [os.write(2, b"x" * 1_000_000) for _ in range(100)]),
    "display killed": Fault(("DisplayLost", "SIGKILL"), when="run"),
    "Ctrl-C": Fault(CTRL_C, when="run"),
    "Ctrl-C three times": Fault(CTRL_C, when="run"),
    "SIGKILL of pytest": Fault(when="run"),
    "SIGTERM of pytest": Fault(when="run"),
}


class Chaos(Simulator):
    """Comes before the real adapter in the order of methods."""

    fault = FAULTS[os.environ.get("CHAOS", "none")]
    happened = False

    def read_back(self) -> dict[str, Any]:
        if self.fault.when == "later":  # this is about the last thing before the answer
            threading.Timer(0.5, self.fault.do).start()
        return super().read_back()  # type: ignore[safe-super]

    def step(self) -> None:
        super().step()  # type: ignore[safe-super]
        due = self.fault.when == "step" and not self.happened and super().time >= AT
        if due or self.fault.when == "every step":
            self.happened = True
            self.fault.do()

    def body_state(self) -> FloatArray:
        state = super().body_state()  # type: ignore[safe-super]
        due = self.fault.when == "state" and super().time > AT  # type: ignore[safe-super]
        return self.fault.do(state) if due else state

    @property
    def time(self) -> float:
        now: float = super().time  # type: ignore[safe-super]
        return self.fault.do(now) if self.fault.when == "time" and now > AT else now


def __getattr__(name: str) -> type[Simulator]:
    if name not in ENGINES:
        raise AttributeError(name)
    return type(name, (Chaos, registered()[name].load()), {})
