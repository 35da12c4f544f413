"""Faults for chaos.py: the real adapters, each with a fault that waits for its moment.

Imported in workers as `chaos_faults:ENGINE`. The fault's name stands in the environment as CHAOS,
the simulated time of its moment [s] as CHAOS_AT.
"""

from __future__ import annotations

import ctypes
import importlib
import os
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from pytest_simbench.scene import FloatArray, Scene
from pytest_simbench.simulator import Simulator

ADAPTERS = {
    "mujoco": "mujoco.adapter:MuJoCo",
    "pybullet": "pybullet.adapter:PyBullet",
    "sapien": "sapien.adapter:SAPIEN",
    "dart": "dart.adapter:DART",
}

SLEEPER = [sys.executable, "-c", "import time; time.sleep(600)"]


def stop() -> None:
    os.kill(os.getpid(), signal.SIGSTOP)


def keep_the_interpreter() -> None:
    """No other thread of this process runs any more."""
    ctypes.PyDLL(None).sleep(600)


def pipes() -> list[int]:
    """execnet's descriptors."""
    found = []
    for name in os.listdir("/proc/self/fd"):
        try:
            if int(name) > 2 and os.readlink(f"/proc/self/fd/{name}").startswith("pipe:"):
                found.append(int(name))
        except OSError:
            continue
    return found


def write_to_pipes(data: bytes) -> None:
    for descriptor in pipes():
        try:
            os.write(descriptor, data)
        except OSError:  # that which is read from
            continue
    time.sleep(600)


def close_pipes() -> None:
    for descriptor in pipes():
        os.close(descriptor)
    time.sleep(600)


def eat() -> None:
    """Memory up to the limit, at 10 MB a moment."""
    hoard = []
    while True:
        hoard.append(np.ones(1_250_000))
        time.sleep(0.02)


def eat_at_once() -> None:
    soft = 2 * 2**40
    resource.setrlimit(resource.RLIMIT_AS, (soft, resource.getrlimit(resource.RLIMIT_AS)[1]))
    np.ones(2**42)


def recurse() -> None:
    recurse()


def raised(error: BaseException) -> Callable[[], None]:
    def fault() -> None:
        raise error

    return fault


def daemon() -> None:
    """A process with another parent and another session."""
    script = "import os\nif os.fork(): os._exit(0)\nos.setsid()\nif os.fork(): os._exit(0)\n"
    subprocess.run([sys.executable, "-c", f"{script}import time; time.sleep(600)"], check=True)


def without_disk() -> None:
    """Every line of the log is one too many."""
    full = os.open("/dev/full", os.O_WRONLY)
    for descriptor in (1, 2):
        os.dup2(full, descriptor)
    print("lost", flush=True)
    print("lost", file=sys.stderr, flush=True)


def without_folder() -> None:
    folder = tempfile.mkdtemp()
    os.chdir(folder)
    os.rmdir(folder)


def fork() -> None:
    """The child answers, too, and first."""
    if os.fork():
        time.sleep(1.0)


def child(number: int | None = None, wait: bool = False) -> Callable[[], None]:
    """A child that gets a signal, and may be waited for, as by an engine with a server."""

    def fault() -> None:
        started = subprocess.Popen(SLEEPER)
        if number is not None:
            started.send_signal(number)
        if wait and started.wait():
            raise subprocess.CalledProcessError(started.returncode, "engine")

    return fault


def signalled(number: int) -> Callable[[], None]:
    return lambda: os.kill(os.getpid(), number)


STEPPING: dict[str, Callable[[], None]] = {
    "SIGSEGV": lambda: ctypes.string_at(0) and None,
    "SIGABRT": os.abort,
    "SIGKILL": signalled(signal.SIGKILL),
    "SIGBUS": signalled(signal.SIGBUS),
    "SIGTERM of the worker": signalled(signal.SIGTERM),
    "SIGSTOP while stepping": stop,
    "hang, interpreter kept": keep_the_interpreter,
    "hang, interpreter free": lambda: time.sleep(600),
    "garbage on stdout": lambda: os.write(1, os.urandom(100_000)) and None,
    "garbage among the messages": lambda: write_to_pipes(b"c" + bytes(8)),
    "half a message": lambda: write_to_pipes(b"\4\0\0\0\1\0\0\3\350half"),
    "connection closed": close_pipes,
    "sys.exit": lambda: sys.exit(4),
    "os._exit": lambda: os._exit(5),
    "exception while stepping": raised(ValueError("the engine is unhappy")),
    "base exception": raised(KeyboardInterrupt("from inside")),
    "huge message": raised(ValueError("y" * 5_000_000)),
    "surrogate message": raised(ValueError("bad \ud800 text")),
    "endless recursion": recurse,
    "memory up to the limit": eat,
    "memory refused": eat_at_once,
    "child left behind": child(),
    "child stopped, left behind": child(signal.SIGSTOP),
    "child stopped, waited for": child(signal.SIGSTOP, wait=True),
    "SIGSEGV of a child": child(signal.SIGSEGV, wait=True),
    "fork that answers": fork,
    "daemon left behind": daemon,
    "full disk for the log": without_disk,
    "log deleted": lambda: os.unlink(os.readlink("/proc/self/fd/1")),
    "folder deleted": without_folder,
    "log flooded": lambda: [os.write(2, b"x" * 1_000_000) for _ in range(100)] and None,
}
"""At the moment, once."""

LATER: dict[str, Callable[[], None]] = {
    "SIGSTOP between requests": stop,
    "interpreter kept between requests": keep_the_interpreter,
}
"""From a thread, just after the world was loaded."""

STATES: dict[str, Callable[[FloatArray], Any]] = {
    "state not a number": lambda b: b * np.nan,
    "state of nothing": lambda b: None,
    "state a text": str,
    "wrong shape": lambda b: b[:, :7],
    "wrong type of number": lambda b: b.astype(np.float32),
    "bodies in another order": lambda b: b[::-1].copy(),
}
"""What becomes of the bodies' state; the first of them from the moment on."""

TIMES: dict[str, Callable[[float], Any]] = {
    "time not a number": lambda t: np.nan,
    "time infinite": lambda t: np.inf,
    "time stands still": lambda t: Chaos.at,
    "time runs back": lambda t: 2 * Chaos.at - t,
    "time jumps": lambda t: t + 100.0,
}
"""What becomes of the time, from the moment on."""

ANSWERS: dict[str, Callable[[dict[str, str]], Any]] = {
    "versions of numbers": lambda found: {**found, "numpy": 2},
}
"""What becomes of the versions."""


class Chaos(Simulator):
    """Comes before the real adapter in the order of methods."""

    fault = os.environ.get("CHAOS", "")
    at = float(os.environ.get("CHAOS_AT", 0.0))
    happened = False

    def __init__(self, *arguments: Any, **options: Any) -> None:
        if self.fault == "exception while starting":
            raise ValueError("no licence")
        super().__init__(*arguments, **options)
        if self.fault == "SIGSTOP while starting":
            stop()

    def load(self, scene: Scene) -> None:
        if self.fault == "SIGSTOP while loading":
            stop()
        if self.fault == "exception while loading":
            raise ValueError("no such shape")
        super().load(scene)  # type: ignore[safe-super]

    def read_back(self) -> dict[str, Any]:
        if self.fault == "exception while reading back":
            raise ValueError("cannot tell")
        if self.fault in LATER:  # this is about the last thing before the answer
            threading.Timer(0.5, LATER[self.fault]).start()
        return super().read_back()  # type: ignore[safe-super]

    def step(self) -> None:
        super().step()  # type: ignore[safe-super]
        if self.fault == "slow":
            time.sleep(0.02)
        if not self.happened and self.time >= self.at:
            self.happened = True
            STEPPING.get(self.fault, lambda: None)()

    def body_state(self) -> FloatArray:
        state = super().body_state()  # type: ignore[safe-super]
        if self.fault in tuple(STATES)[:3] and super().time <= self.at:
            return state
        return STATES.get(self.fault, lambda b: b)(state)  # type: ignore[no-any-return]

    @property
    def time(self) -> float:
        now: float = super().time  # type: ignore[safe-super]
        change = TIMES.get(self.fault) if now > self.at else None
        return change(now) if change else now

    def versions(self) -> dict[str, str]:
        return ANSWERS.get(self.fault, lambda found: found)(super().versions())  # type: ignore[no-any-return]

    def close(self) -> None:
        if self.fault == "exception while closing":
            raise ValueError("already closed")
        if self.fault == "SIGSTOP while closing":
            stop()
        super().close()


def __getattr__(name: str) -> type[Simulator]:
    if name not in ADAPTERS:
        raise AttributeError(name)
    module, _, adapter = ADAPTERS[name].partition(":")
    real = getattr(importlib.import_module(f"pytest_simbench.sims.{module}"), adapter)
    return type(adapter, (Chaos, real), {})
