"""Adapters that misbehave on purpose: a real engine, with one fault each.

Workers load them as `tests.client.faulty:NAME`. Those of `FAULTS` and `MOMENTS` are on MuJoCo or,
as `PyBullet_NAME`, on PyBullet; those of `LIES` and `RAISED` are `Lies KEY` and `Raises KEY`.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from pytest_simbench.sims.mujoco.adapter import MuJoCo
from pytest_simbench.sims.mujoco.settings import MuJoCoSettings
from pytest_simbench.sims.pybullet.adapter import PyBullet

from pytest_simbench.scene import Scene
from pytest_simbench.simulator import Deviation, ParityError, Simulator, UnavailableError
from pytest_simbench.worker.server import Server

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


COMPILE_SECONDS = 1.5


class Costly(Simulator):
    """Takes a while to compile, once per process, and is therefore used for many repetitions."""

    compiled = 0

    def compile(self, scene: Scene) -> None:
        if not Costly.compiled:
            time.sleep(COMPILE_SECONDS)
        Costly.compiled += 1


class Restless(Simulator):
    """Does not put the clock back when it loads again."""

    def load(self, scene: Scene) -> None:
        super().load(scene)
        Restless.loads += 1
        for _ in range(Restless.loads - 1):
            self.step()

    loads = 0


@dataclass(frozen=True)
class OddSettings(MuJoCoSettings):
    def to_wire(self) -> Any:
        return {3: 0.001}


LIES: dict[str, dict[str, Any]] = {
    "versions": {"versions": lambda self: {"mujoco": "3.3", "numpy": None}},
    "names of versions": {"versions": lambda self: {"mujoco": "3.3", 3: "4"}},
    "untested": {"untested": lambda self: 3},
    "settings": {"profiles": {"tuned": OddSettings(0.001)}},
    "deviations": {
        "info": replace(MuJoCo.info, deviations=(*MuJoCo.info.deviations, Deviation("", 3))),
    },
    "no dict of versions": {"versions": lambda self: 3},
    "versions that cannot be sent": {
        "versions": lambda self: {"mujoco": "3.3", "numpy": Unprintable}
    },
    "bodies": {"body_state": lambda self: MuJoCo.body_state(self)[:-1]},
    "time": {"time": property(lambda self: min(0.3, MuJoCo.time.fget(self)))},
    "joints": {"joint_state": lambda self: MuJoCo.joint_state(self)[:, [2, 1, 0, *range(3, 9)]]},
}
"""What an adapter says, of another type than it must be."""


class Unprintable(Exception):
    def __str__(self) -> str:
        raise RuntimeError("no text")

    __repr__ = __str__


class Derived(UnavailableError):
    """An adapter's own kind of one of ours."""


RAISED: dict[str, Any] = {
    "surrogate": lambda: ValueError("bad \ud800 text"),
    "huge": lambda: ValueError("y" * 5_000_000),
    "no_text": Unprintable,
    "exit": lambda: SystemExit(3),
    "parity": lambda: ParityError("\udfff" * 3000),
    "derived": lambda: Derived("no driver"),
}


class Parent(MuJoCo):
    """Starts processes that want to stay: a child, one with another session and parent, and one
    that has thrown its environment away as well. Their ids are in the file of `UNRULY`, in this
    order."""

    def load(self, scene: Scene) -> None:
        super().load(scene)
        sleep = "import os,time; print(os.getpid(), flush=True); time.sleep(600)"
        daemon = (
            "import os,sys\nif os.fork(): os._exit(0)\nos.setsid()\nif os.fork(): os._exit(0)\n"
        )
        with open(os.environ["UNRULY"], "ab") as ids:
            subprocess.Popen([sys.executable, "-c", sleep], stdout=ids)
            for number, environment in enumerate((None, {}), 1):
                self._wait_for(number)
                subprocess.run(
                    [sys.executable, "-c", daemon + sleep],
                    stdout=ids,
                    env=environment,
                    check=True,
                )
        self._wait_for(3)

    def _wait_for(self, number: int) -> None:
        while Path(os.environ["UNRULY"]).read_text().count("\n") < number:
            time.sleep(0.01)


class ParentThatDies(Parent):
    def step(self) -> None:
        os.kill(os.getpid(), signal.SIGKILL)


HAUNTED = 0.5
"""Simulated time from which on a cube does what no cube can [s]."""


class Flying(MuJoCo):
    """One cube is blown away, through whatever is in the way, at 10 m/s."""

    def step(self) -> None:
        super().step()
        if self.time >= HAUNTED:
            self.data.qvel[0] = 10.0


class Faulty(Simulator):
    """Does `fault` once its time has come, until that is done."""

    done = False
    fault: Callable[[Any], object]

    def step(self) -> None:
        super().step()  # the engine comes next in the method order
        if self.time >= FAULT_TIME and not self.done:
            self.done = bool(self.fault())


def kill(number: int) -> Callable[[Any], None]:
    return lambda simulator: os.kill(os.getpid(), number)


def crash(simulator: Any) -> None:
    ctypes.string_at(0)  # reads address 0: a true segmentation fault


def hold(simulator: Any) -> None:
    """In C code that holds the GIL, so that no other thread of the worker runs either."""
    ctypes.PyDLL(None).sleep(600)


def complain(simulator: Any) -> None:
    raise ValueError("the engine is unhappy")


def eat(simulator: Any) -> None:
    """20 MB more at every step."""
    simulator.__dict__.setdefault("hoard", []).append(np.ones(2_500_000))
    time.sleep(0.01)


def flood(simulator: Any) -> bool:
    """100 MB before anybody looks, and all goes on well."""
    for _ in range(100):
        os.write(2, (b"x" * 99 + b"\n") * 10_000)
    return True


def fork(simulator: Any) -> bool:
    """Go on in the child, too. The parent comes second."""
    if os.fork():
        time.sleep(1.0)
    return True


def _connections() -> list[int]:
    """execnet's descriptors: the pipes other than stdin, stdout and stderr."""
    found = []
    for name in os.listdir("/proc/self/fd"):
        try:
            target = os.readlink(f"/proc/self/fd/{name}")
        except OSError:
            continue
        if int(name) > 2 and target.startswith("pipe:"):
            found.append(int(name))
    return found


def hang_up(simulator: Any) -> None:
    """Close the connection and live on."""
    for descriptor in _connections():
        os.close(descriptor)
    time.sleep(600.0)


def send(message: bytes) -> None:
    """Where the messages go, and nothing after it."""
    for descriptor in _connections():
        with contextlib.suppress(OSError):  # the other direction
            os.write(descriptor, message)
    time.sleep(600.0)


FAULTS: dict[str, Callable[[Any], object]] = {
    "Killed": kill(signal.SIGKILL),
    "Stopped": kill(signal.SIGSTOP),
    "Crashed": crash,
    "Hung": hold,
    "Raising": complain,
    "NotANumber": lambda simulator: SPOIL[simulator.info.name](simulator),
    "Greedy": eat,
    "ExitsAtOnce": lambda simulator: os._exit(7),
    "Aborts": lambda simulator: os.abort(),
    "FloodsTheLog": lambda simulator: (flood(simulator), time.sleep(600.0)),
    "FloodsAtOnce": flood,
    "Forks": fork,
    "ForksOn": lambda simulator: [os.fork()],
    "HangsUp": hang_up,
    "HalfAnswer": lambda simulator: send(b"\4\0\0\0\1\0\0\3\350" + b"0123456789"),  # of 1000 bytes
    "Garbage": lambda simulator: send(b"c" + bytes(8)),  # a message of no known kind
}
"""What an engine does in the middle of a motion."""


def soon(act: Callable[[Any], object]) -> Callable[[Any], None]:
    """A moment later, when the answer is sent."""
    return lambda simulator: threading.Timer(0.3, act, (simulator,)).start()


def chatter(simulator: Any) -> None:
    """Say that it is alive as often as it can, each time a little later."""
    server = next(o for o in gc.get_objects() if isinstance(o, Server))
    for k in range(10**9):
        server.send({"alive": simulator.time + k})


def leave_files(simulator: Any) -> None:
    Path(os.environ["UNRULY"]).write_text(tempfile.mkdtemp())


INSTEAD, AFTER = False, True
"""Instead of what the engine does, or when it has done it."""

MOMENTS: dict[str, tuple[str, bool, Callable[[Any], object]]] = {
    "StopsBeingMade": ("__init__", AFTER, kill(signal.SIGSTOP)),
    "NeverCompiled": ("compile", INSTEAD, lambda simulator: time.sleep(600)),
    "StopsLoading": ("load", INSTEAD, kill(signal.SIGSTOP)),
    "ExitsLoading": ("load", INSTEAD, lambda simulator: sys.exit(5)),
    "WrongGravity": ("load", AFTER, lambda simulator: HEAVIER[simulator.info.name](simulator)),
    "LeavesFiles": ("load", AFTER, leave_files),
    # so that nobody reads the next request, in the latter since no other thread runs
    "StopsBetweenRequests": ("load", AFTER, soon(kill(signal.SIGSTOP))),
    "HoldsTheInterpreter": ("load", AFTER, soon(hold)),
    # to the real stdout, where execnet's messages would go
    "Chatty": ("step", AFTER, lambda simulator: os.write(1, b"\xff\x00garbage\n")),
    "Chatters": ("step", AFTER, chatter),
    "StopsClosing": ("close", INSTEAD, kill(signal.SIGSTOP)),
    "CrashesClosing": ("close", INSTEAD, kill(signal.SIGSEGV)),
}
"""What it does when it is asked for something."""

COSTLY = ("Costly", "NeverCompiled", "Restless")


def asked(fault: str, cls: type[Simulator]) -> type[Simulator]:
    """The engine with a fault of `MOMENTS`."""
    method, after, act = MOMENTS[fault]

    def does(self: Any, *arguments: Any, **options: Any) -> None:
        if after:
            getattr(cls, method)(self, *arguments, **options)
        act(self)

    return type(fault, (cls,), {method: does})


def raise_one(key: str) -> None:
    raise RAISED[key]()


def __getattr__(name: str) -> Any:
    kind, _, key = name.partition(" ")
    if kind == "Lies" and key:
        return type("Lies", (MuJoCo,), LIES[key])
    if kind == "Raises" and key:
        return type("Raises", (Faulty, MuJoCo), {"fault": lambda simulator: raise_one(key)})
    engine, fault = f"MuJoCo_{name}".split("_")[-2:]  # MuJoCo unless it says another
    if engine not in ENGINES:
        raise AttributeError(name)
    cls = ENGINES[engine]
    if fault in FAULTS:
        return type(name, (Faulty, cls), {"fault": FAULTS[fault]})
    if fault in MOMENTS:
        made = asked(fault, cls)
    elif fault in COSTLY:
        made = type(name, ({"Costly": Costly, "Restless": Restless}[fault], cls), {})
    else:
        raise AttributeError(name)
    made.info = replace(cls.info, costly_start=fault in COSTLY)
    return made
