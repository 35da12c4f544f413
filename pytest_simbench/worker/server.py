"""The request loop in the simulator's process.

Imports nothing but rooms below it, numpy and the standard library, so that it runs in an
interpreter that holds nothing but the engine. Each request is a dict
`{"op": name, "number": n, ...}`; the answer has the same number, and is `{"ok": result}` or
`{"error": {type, message}}`. In between may come any number of times `{"alive": simulated time}`,
and `{"frame": {time, seconds, picture or problem}}` while a film is taken.
"""

from __future__ import annotations

import gc
import importlib
import os
import socket
import sys
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict
from typing import Any

import numpy as np

from pytest_simbench import __version__
from pytest_simbench.description.links import check_names
from pytest_simbench.description.robot_files import received
from pytest_simbench.description.urdf import PreparedRobot
from pytest_simbench.parity.compare import check, misfit
from pytest_simbench.parity.quantities import expected_quantities
from pytest_simbench.parity.readback import remembering
from pytest_simbench.scene import Scene, Trajectory
from pytest_simbench.scene.pair_friction import combined
from pytest_simbench.scene.pair_restitution import unlike
from pytest_simbench.simulator import Simulator, SimulatorError, SimulatorInfo
from pytest_simbench.simulator.info import alternatives, check_supported, importable
from pytest_simbench.simulator.settings import changed
from pytest_simbench.simulator.settings import profile as profile_of
from pytest_simbench.worker.loop import Loop, told_forces
from pytest_simbench.worker.loop import inside as run_inside
from pytest_simbench.worker.loop import outside as run_outside
from pytest_simbench.worker.state import (
    check_following,
    check_start,
    checked_quantities,
    checked_state,
)
from pytest_simbench.worker.stepping import Acting, Stepper
from pytest_simbench.worker.watching import Watch
from pytest_simbench.worker.wire import LONGEST_LOGGED, Frames, named, pack, readable, told, unpack


def peak_rss_mb() -> float | None:
    """Largest resident set of this process so far [MB], exact, from the kernel.

    VmHWM belongs to the address space; `getrusage` would report the parent's peak, which a
    forked child inherits.
    """
    try:
        with open("/proc/self/status", encoding="ascii") as status:
            for line in status:
                if line.startswith("VmHWM:"):
                    return int(line.split()[1]) * 1024 / 1e6
    except OSError:
        pass
    return None


def reset_peak_rss() -> None:
    """Start the peak anew, for a worker that serves several repetitions (`man proc`)."""
    with suppress(OSError), open("/proc/self/clear_refs", "w", encoding="ascii") as file:
        file.write("5")


class Server:
    """Answers the requests of one client for one simulator."""

    def __init__(
        self,
        send: Callable[[Any], None],
        receive: Callable[[], Any] = lambda: None,
        exchange: Frames | None = None,
    ) -> None:
        self.send, self.receive, self.exchange = send, receive, exchange
        self.simulator: Simulator | None = None
        self.stepper: Stepper | None = None
        self.scene = Scene("empty")
        self.compared: tuple[dict[str, Any], dict[str, Any]] | None = None
        self.saved: dict[str, Any] = {}
        self.number, self.pid = 0, os.getpid()

    def answer(self, request: dict[str, Any]) -> None:
        """Carry out one request and send its answer, whatever happens."""
        self.number = request.pop("number")
        try:
            operation = getattr(self, f"do_{request.pop('op')}")
            self.send({"number": self.number, "ok": pack(operation(**unpack(request)))})
        except SimulatorError as error:
            self._send_error(error, _typed(error), told(error))
        except MemoryError as error:
            self._send_error(error, "MemoryError", told(error) or "out of memory")
        except SystemExit as error:
            self._send_error(error, "SystemExit", f"the adapter called {_exit_call(error)}")
        except BaseException as error:  # whatever an adapter raises, it is an answer
            self._send_error(error, "EngineError", named(error))

    def _send_error(self, error: BaseException, name: str, message: str) -> None:
        with suppress(Exception):  # a full disk, an exception that cannot be printed
            trace = "".join(traceback.format_exception(error))
            print(readable(trace, LONGEST_LOGGED), file=sys.stderr, flush=True)
        self.send({"number": self.number, "error": {"type": name, "message": message}})

    def do_hello(self) -> dict[str, Any]:
        return {
            "pid": os.getpid(),
            "version": __version__,
            "python": ".".join(map(str, sys.version_info[:3])),
        }

    def do_construct(
        self, adapter: str, profile: str, changes: dict[str, Any], gui: bool, real_time: bool
    ) -> dict[str, Any]:
        """Import the adapter (`module:Class`) and give it its settings."""
        module, _, name = adapter.partition(":")
        cls: type[Simulator] = getattr(importlib.import_module(module), name)
        if not gui:
            for variable, value in cls.info.environment.items():
                os.environ.setdefault(variable, value)
        _import_engine(cls.info)
        gc.enable()  # off since the first import
        settings = changed(profile_of(cls.profiles, profile, cls.info.name), changes, cls.info.name)
        if self.simulator is not None:
            self.simulator.close()  # a reused worker starts each world anew
        self.stepper = None
        self.saved.clear()
        reset_peak_rss()
        self.simulator = cls(settings, gui=gui)
        versions = self.simulator.versions()
        if refused := cls.info.refused(versions.get(cls.info.distribution, "")):
            raise SimulatorError(refused)
        self.real_time = real_time
        return {
            "settings": settings.to_wire(),
            "versions": versions,
            "untested": self.simulator.untested(),
        }

    def do_read_file(self, path: str) -> dict[str, Any]:
        scene, account = self._constructed().read_file(path)
        starts = [start.to_wire() for start in scene.starts]
        lines = [line.to_wire() for line in account]
        return {"scene": scene.to_wire(), "starts": starts, "account": lines}

    def do_compile(self, scene: dict[str, Any]) -> None:
        self._constructed().compile(Scene.from_wire(received(scene)))

    def do_load(self, scene: dict[str, Any], parity: bool) -> dict[str, Any]:
        simulator = self._constructed()
        world = Scene.from_wire(received(scene))
        check_names(world)
        check_supported(simulator.info, world)
        prepared = PreparedRobot(world.robot).links if world.robot and world.apart else {}
        links = [name for name, link in prepared.items() if link.shapes]
        world, inexact = combined(world, simulator.info.friction_rule, links)
        excused = [*filter(None, (inexact, unlike(world)))]
        simulator.load(world)
        self.scene = world
        acting = Acting.of(simulator, world)
        self.stepper = Stepper(simulator, world, lambda at: self.send({"alive": at}), acting)
        self.stepper.real_time = self.real_time
        check_start(simulator, world)
        self.compared = None
        if parity:
            expected, reported = (
                expected_quantities(world, simulator.settings),
                checked_quantities(simulator),
            )
            info = simulator.info
            counting = (deviation for deviation in info.deviations if deviation.concerns(world))
            declared = [deviation.with_robot(world.robot) for deviation in counting]
            excused += check(expected, reported, declared, info.name)
            self.compared = expected, reported
        if simulator.gui:
            simulator.refresh_window()
        return {
            "excused": excused,
            "timestep": simulator.settings.timestep,
            **self.do_state(),
        }

    def do_watch(self, seed: int) -> None:
        """From now on, look whether the world stays as it was loaded; see `Watch`."""
        if self.compared is not None:
            self._loaded().watch = Watch(self._constructed(), self.scene, *self.compared, seed)

    def do_read_again(self) -> None:
        """Whether the engine still holds what it held when the world was loaded, if watched."""
        watch = self._loaded().watch
        if watch is not None:
            watch.read()

    def do_misfit(self, names: list[str]) -> float:
        """The largest of some bodies' (`parity.compare.misfit`), if the world was compared."""
        return max(misfit(*self.compared, name) for name in names) if self.compared else 0.0

    def do_read_back(self, remember: dict[str, Any] | None = None) -> dict[str, Any]:
        """What the engine says; the adapter made to remember another scene meanwhile, if given."""
        simulator = self._constructed()
        if remember is None:
            return checked_quantities(simulator)
        with remembering(simulator, Scene.from_wire(remember)):
            return checked_quantities(simulator)

    def do_state(self) -> dict[str, Any]:
        return checked_state(self._constructed(), self.scene)

    def do_follow(
        self, tick: float, position: Any, velocity: Any, effort: Any, log_period: float | None
    ) -> dict[str, Any]:
        trajectory = Trajectory(tick, position, velocity, effort)
        answer = self._moved(self._loaded().follow(trajectory, log_period))
        check_following(self._constructed(), self.scene, answer["joints"], position[-1])
        return answer

    def do_wait(self, duration: float, log_period: float | None) -> dict[str, Any]:
        return self._moved(self._loaded().wait(duration, log_period))

    def do_close_loop(
        self,
        every: int,
        most: int,
        late: int,
        log_period: float | None,
        forces: bool,
        picture: list[int] | None,
        inside: dict[str, Any] | None,
    ) -> dict[str, Any]:
        """Step under a policy: the client's, which is asked by messages, or one that runs here."""
        try:
            stepper, period = self._loaded(), every * self._constructed().settings.timestep
            if inside is not None:
                answer = run_inside(self.scene, stepper.told, period, inside)
            else:
                looks: list[Callable[[], bytes]] = []
                if picture is not None:
                    looks.append(lambda: np.asarray(self.do_render(*picture)).tobytes())
                if forces:
                    looks.append(lambda: told_forces(self.do_contact_forces()))
                answer = run_outside(self._exchange, looks)
            loop = Loop(every, most, late, stepper.told, period, answer)
            return self._moved(stepper.close_loop(loop, log_period))
        finally:
            if self.exchange is not None and inside is None:  # else nobody reads it
                self.exchange.send(b"")  # no question: the answer comes

    def _exchange(self, question: bytes) -> bytes | None:
        """The client's reply to a question.

        Raises:
            RuntimeError: the engine forked, and this is its child.
        """
        if os.getpid() != self.pid:
            self.number = 0  # of no request, so that the client sees that two answer
            raise RuntimeError("a fork of the worker asks, too")
        if self.exchange is None:
            self.send(question)
            reply: bytes | None = self.receive()
            return reply
        self.exchange.send(question)
        return self.exchange.receive()

    def _moved(self, log: dict[str, Any]) -> dict[str, Any]:
        watch = self._loaded().watch
        if watch is not None:
            watch.check_log(log)
            return {"log": log, "aside": watch.spent(), **self.do_state()}
        return {"log": log, **self.do_state()}

    def do_save(self, name: str) -> None:
        self.saved[name] = self._constructed().save(), self._loaded().told

    def do_restore(self, name: str) -> dict[str, Any]:
        kept, set_points = self.saved[name]
        self._constructed().restore(kept)
        state, stepper = self.do_state(), self._loaded()
        stepper.told = set_points
        if stepper.watch is not None:
            stepper.watch.restored(stepper.clocks.steps, state["joints"], state["bodies"])
        return state

    def do_contact_count(self) -> int:
        return self._constructed().contact_count()

    def do_contact_forces(self) -> list[tuple[str, str, Any]]:
        """Of each pair once: the sum of what the simulator tells of it."""
        total: dict[tuple[str, str], Any] = {}
        for first, second, wrench in self._constructed().contact_forces():
            pair, sign = (first, second), 1.0
            if second < first:
                pair, sign = (second, first), -1.0
            total[pair] = total.get(pair, 0.0) + sign * np.asarray(wrench, dtype=float)
        return [(*pair, wrench) for pair, wrench in total.items()]

    def do_joint_wrenches(self) -> Any:
        return np.asarray(self._constructed().joint_wrenches(), dtype=float)

    def do_render(self, width: int, height: int) -> Any:
        return self._constructed().render(width, height)

    def do_film(self, period: float | None, width: int, height: int) -> float | None:
        """Send a picture every `period` [s] of simulated time from now on, or stop (None).

        Returns:
            The period that there is, of whole steps [s].
        """
        stepper, timestep = self._loaded(), self._constructed().settings.timestep
        if period is None:
            stepper.film = None
            return None
        every = max(1, round(period / timestep))
        stepper.film = every, lambda: self._shoot(width, height)
        return every * timestep

    def _shoot(self, width: int, height: int) -> None:
        """Send one picture; the first that cannot be drawn is told, and the film's last."""
        began = time.perf_counter()
        frame: dict[str, Any] = {"time": self._constructed().time}
        try:
            frame["picture"] = pack(self._constructed().render(width, height))
        except Exception as error:  # a film is not what is measured
            frame["problem"] = told(error) if isinstance(error, SimulatorError) else named(error)
            self._loaded().film = None
        self.send({"frame": {**frame, "seconds": time.perf_counter() - began}})

    def do_stats(self) -> dict[str, Any]:
        """Clocks of the stepping loop and of the control workload, and the exact memory peak."""
        clocks: dict[str, Any] = {}
        if self.stepper is not None:
            clocks = {**asdict(self.stepper.clocks), **self.stepper.control.to_wire()}
        return {"stepping": clocks, "peak_rss_mb": peak_rss_mb()}

    def do_close(self) -> None:
        if self.simulator is not None:
            self.simulator.close()

    def _constructed(self) -> Simulator:
        if self.simulator is None:
            raise SimulatorError("no simulator was constructed yet")
        return self.simulator

    def _loaded(self) -> Stepper:
        if self.stepper is None:
            raise SimulatorError("no scene was loaded yet")
        return self.stepper


def _typed(error: SimulatorError) -> str:
    """Its type, by the name that the client knows: that of the class an adapter derived it from."""
    known = (kind for kind in type(error).__mro__ if kind.__module__ == SimulatorError.__module__)
    return next(known).__name__


def _exit_call(error: SystemExit) -> str:
    """What was called, and the status that it means: a text means 1, nothing means 0."""
    if error.code is None or isinstance(error.code, int):
        return f"sys.exit({error.code or 0})"
    return f"sys.exit({told(error)!r}), status 1"


def _import_engine(info: SimulatorInfo) -> None:
    for modules in info.modules:
        names = alternatives(modules)
        try:
            importlib.import_module(next(filter(importable, names), names[0]))
        except ImportError as error:
            raise SimulatorError(
                f"{info.title} does not import ({error}); it is missing or half installed in "
                f"{sys.executable}: {info.install}"
            ) from error


def serve(
    receive: Callable[[], Any], send: Callable[[Any], None], exchange: int | None = None
) -> None:
    """Answer requests until the client asks to close; `exchange`: descriptor of a socket to it."""
    server = Server(
        send, receive, None if exchange is None else Frames(socket.socket(fileno=exchange))
    )
    while True:
        request = receive()
        closing = request.get("op") == "close"
        server.answer(request)
        if closing:
            return
