"""A worker's process: requests, limits of their time, death. `connection` knows execnet."""

from __future__ import annotations

import contextlib
import importlib.util
import shutil
import signal
import threading
import time
from collections.abc import Callable, Generator, Mapping
from pathlib import Path
from typing import Any

import msgspec
import psutil
from packaging.utils import canonicalize_version

from pytest_simbench import __version__
from pytest_simbench.client import bootstrap, reaper
from pytest_simbench.client.answers import Constructed, Frame, checked
from pytest_simbench.client.connection import Connection, RemoteError, elsewhere
from pytest_simbench.client.errors import (
    REFUSALS,
    REMOTE_ERRORS,
    EngineFailed,
    Interrupted,
    OutOfMemory,
    ProtocolError,
    RepetitionTimeout,
    Where,
    WorkerError,
    WorkerExited,
    WorkerHung,
    WorkerStartError,
    exit_text,
)
from pytest_simbench.client.launch import Launch
from pytest_simbench.client.resources import crowding
from pytest_simbench.ground.versions import RELEASE, VersionedName
from pytest_simbench.simulator.registry import adapter
from pytest_simbench.worker.wire import named, pack, readable, unpack

LOOK_PERIOD = 1.0
"""Wall time between two looks at the log and the limits while waiting for an answer [s]."""

LEAST_START = 1.0
"""For an interpreter to start, and for its hello, however short silence may be else [s]."""

EXIT_TIMEOUT = 2.0
"""The pipe breaks a moment before the process can be waited for [s]."""

CLOSE_TIMEOUT = 10.0
"""For an engine to release what it holds [s]; then it is ended, and the record says so."""


class WorkerProcess:
    """One worker, from its start to its end. No method waits longer than the limits say.

    Args:
        where: kept up to date by the owner; every error carries it.
        deadline: see below; counts while starting, too.
        made: told of this object before the start, so that another thread may `interrupt` it.

    Attributes:
        pid: of the worker's process; of its host when that is another one.
        deadline: `time.monotonic()` at which the repetition times out, None for never.
        busy: a request was sent and its answer not received; after an exception from elsewhere
            (Ctrl-C, a time-out of the test) the next answer would be the wrong one.
    """

    def __init__(
        self,
        launch: Launch,
        where: Where,
        *,
        deadline: float | None = None,
        made: Callable[[WorkerProcess], None] = lambda process: None,
    ) -> None:
        self.launch = launch
        self.where = where
        self.deadline = deadline
        self.busy = False
        self._asked = 0
        self.pid: int | None = None
        self.python_version = ""
        self._mark = reaper.new_mark()
        self._temporary = reaper.folder_of(self._mark)
        self._family: set[psutil.Process] = set()
        self._reason: tuple[type[WorkerError], str] | None = None
        self._ended = False
        self._lock = threading.Lock()
        self._connection = Connection(
            launch.spec,
            launch.python,
            {
                **({"TMPDIR": str(self._temporary)} if self._temporary else {}),
                **launch.environment,
                reaper.VARIABLE: self._mark,
            },
            launch.log,
        )
        made(self)
        try:
            self._start()
        except BaseException:
            self.kill()
            raise

    def _start(self) -> None:
        launch = self.launch
        self._connection.open(bootstrap, self._configuration())
        limit = max(launch.stall_timeout, LEAST_START)
        self._next(limit, self._not_started)
        hello = self.request("hello", timeout=limit)
        self.pid = hello["pid"]
        self.python_version = hello["python"]
        if hello["version"] != __version__:
            raise WorkerStartError(
                f"the worker runs pytest-simbench {hello['version']}, this is {__version__}; "
                "install the same version on both sides",
                self.where,
            )

    def _configuration(self) -> dict[str, Any]:
        log = self.launch.log
        return {
            "log": str(log or ""),
            "folder": str(log.parent.absolute()) if log and log.parent != Path("/dev") else "",
            "packages": self._packages(),
            "exchange": self._connection.descriptor,
        }

    def _packages(self) -> dict[str, str]:
        """Where the packages that the worker needs lie: this one, the adapters, a third party's."""
        if elsewhere(self.launch.spec):
            return {}  # another host has its own installation
        names = {"pytest_simbench", "pytest_simbench.sims"}
        names.add(self.launch.adapter.partition(":")[0].split(".")[0])
        specs = {name: importlib.util.find_spec(name) for name in names}
        return {name: s.origin for name, s in specs.items() if s is not None and s.origin}

    def request(self, operation: str, *, timeout: float | None = None, **arguments: Any) -> Any:
        """Send one request and wait for its answer.

        Args:
            operation: of `worker.server.Server`.
            timeout: for the whole request [s]; None: silence ends it after `stall_timeout`.

        Raises:
            WorkerError: one of its kinds; the worker is dead then, unless it is `EngineFailed`.
        """
        self._ask(operation, arguments)
        return self._answer(operation, self._next(timeout, self._hung))

    def converse(self, operation: str, **arguments: Any) -> Generator[bytes, bytes | None, Any]:
        """A request during which the worker asks back: yields its questions, takes the replies.

        Closing the generator ends the operation, as the reply None does, and raises nothing; else
        errors as `request`.

        Returns:
            The answer to the request.
        """
        self._ask(operation, arguments)
        connection = self._connection
        while isinstance(message := self._next(None, self._hung, connection.take), bytes):
            try:
                reply = yield message
            except GeneratorExit:
                connection.reply(None)
                with contextlib.suppress(WorkerError):  # what ended it is told already
                    self._answer(operation, self._next(None, self._hung, connection.take))
                raise
            connection.reply(reply)
        return self._answer(operation, message)

    def _ask(self, operation: str, arguments: Mapping[str, Any]) -> None:
        if self._connection.unread and not self._ended:
            self._unread()
        self.launch.shorten_log()
        self.busy = True
        self._asked += 1
        self._connection.send({"op": operation, "number": self._asked, **pack(arguments)})

    def _answer(self, operation: str, answer: Any) -> Any:
        """What a message answers to the last request; errors as `request`."""
        self.busy = False
        try:
            if answer["number"] != self._asked:
                problem = (
                    f"request {self._asked} ({operation}) got the answer to request "
                    f"{answer['number']:d}; this happens where an engine forks and its child "
                    "answers, too"
                )
            elif "error" in answer:
                error = self._remote_error(answer["error"], operation)
                problem = ""
            else:
                return checked(operation, unpack(answer["ok"]))
        except msgspec.ValidationError as wrong:
            problem = f"the answer to {operation!r} has a wrong type: {wrong}; mend the adapter"
        except Exception:
            problem = f"unreadable answer {answer!r:.80}"
        raise self._ended_by(ProtocolError, problem) if problem else error

    def construct(
        self,
        profile: str = "tuned",
        changes: Mapping[str, Any] | None = None,
        *,
        gui: bool = False,
        real_time: bool = False,
        adapter: str | None = None,
        timeout: float | None = None,
    ) -> Constructed:
        """Have the worker make its simulator; one that it made before is closed.

        Args:
            changes: single settings that differ from the profile, by name.
            real_time: whether stepping keeps step with the wall clock.
            adapter: `module:Class`; default: the one that the worker was launched for.
            timeout: for the whole request [s]; None: silence ends it after `stall_timeout`.

        Raises:
            WorkerError: as `request`; its engine is of another version than the simulator's name
                says.
        """
        constructed: Constructed = self.request(
            "construct",
            timeout=timeout,
            adapter=adapter or self.launch.adapter,
            profile=profile,
            changes=dict(changes or {}),
            gui=gui,
            real_time=real_time,
        )
        if problem := _another_release(self.where.simulator, constructed.versions):
            raise self._ended_by(WorkerStartError, problem)
        return constructed

    def film(
        self, take: Callable[[Frame], None] | None, period: float, size: tuple[int, int]
    ) -> None:
        """Have a picture of the loaded world taken every `period` [s] of simulated time.

        Args:
            take: gets each frame, in another thread, while a motion is asked for; must not raise.
                The time that drawing takes puts the deadline off. None: no more pictures.
            size: width and height [pixels].
        """

        def arrived(data: Any) -> None:
            frame = Frame.from_wire(data, size)
            if self.deadline is not None:
                self.deadline += frame.seconds
            if take is not None:
                take(frame)

        self._connection.on_frame = None if take is None else arrived
        width, height = size
        wanted = None if take is None else period
        self.request("film", period=wanted, width=width, height=height)

    def _unread(self) -> None:
        """Something came between two requests: the end, or what nobody asked for."""
        message = self._next(EXIT_TIMEOUT, self._hung)
        raise self._ended_by(ProtocolError, f"{message!r:.80} came, and nobody had asked")

    def _next(
        self,
        timeout: float | None,
        late: Callable[[float], WorkerError],
        receive: Callable[[float], Any] | None = None,
    ) -> Any:
        """The worker's next message.

        Args:
            timeout: [s]; None: the limit of silence.
            late: the error when that time is over.
            receive: from where; default: `Connection.receive`.
        """
        receive = receive or self._connection.receive
        began = time.monotonic()
        limit = self.launch.stall_timeout if timeout is None else timeout
        while True:
            # Signs of life put the end off, unless the request as a whole is limited.
            since = max(began, self._connection.heard) if timeout is None else began
            now, until, error = time.monotonic(), since + limit, late
            if self.deadline is not None and self.deadline < until:
                until, error = self.deadline, self._timed_out
            if now >= until:
                raise error(limit)
            try:
                return receive(min(until - now, LOOK_PERIOD))
            except TimeoutError:
                self.launch.shorten_log()
            except EOFError:
                raise self._exited() from None
            except Exception as problem:  # of starting, of sending, or out of the bootstrap there
                raise self._exited(problem) from None

    def _remote_error(self, error: dict[str, str], operation: str) -> WorkerError:
        kind = REMOTE_ERRORS.get(error["type"], EngineFailed)
        if error["type"] == "NotSupportedError":
            kind = REFUSALS.get(operation, kind)
        found = kind(error["message"], self.where, self.launch.log_tail())
        if isinstance(found, EngineFailed):
            found.remote = error["type"]
        return found

    def _hung(self, limit: float) -> WorkerError:
        what = (
            f"the worker gave no sign of life for {limit:g} s and was killed; raise "
            "--sim-stall-timeout if the engine is only slow"
        )
        return self._ended_by(WorkerHung, what + self._crowding())

    def _not_started(self, limit: float) -> WorkerError:
        return self._ended_by(
            WorkerStartError, self._start_text(f"no handshake within {limit:g} s")
        )

    def _timed_out(self, limit: float) -> WorkerError:
        what = (
            "the repetition took longer than its time-out and was ended; raise --sim-timeout if "
            "the simulator is only slow"
        )
        return self._ended_by(RepetitionTimeout, what + self._crowding())

    def _crowding(self) -> str:
        return "" if elsewhere(self.launch.spec) or self.pid is None else crowding(self.pid)

    def _start_text(self, reason: str) -> str:
        interpreter = self.launch.spec or self.launch.python or "this interpreter"
        return (
            f"cannot start a worker with {interpreter} ({reason}); check the path given "
            "with --sim-python or --sim-spec: it must be a Python interpreter with the engine "
            "and numpy, printing nothing of its own"
        )

    def _exited(self, problem: Exception | None = None) -> WorkerError:
        """The error for a connection that ended, or never began."""
        there = isinstance(problem, RemoteError)  # out of the bootstrap: the process lives on
        code = None if self._ended or there else self._connection.status(EXIT_TIMEOUT)
        if code == -signal.SIGINT and self.pid is None:  # Ctrl-C met it before its own session
            return self._ended_by(Interrupted, "the run was interrupted")
        if self.pid is None and (code is None or code >= 0):
            if there:
                reason = readable(str(problem).strip().rpartition("\n")[2])
            else:
                reason = named(problem) if problem and code is None else f"it {exit_text(code)}"
            return self._ended_by(WorkerStartError, self._start_text(reason))
        if problem is not None and code is None:
            return self._ended_by(ProtocolError, f"the connection failed: {named(problem)}")
        return self._ended_by(WorkerExited, f"the worker {exit_text(code)}")

    def _ended_by(self, kind: type[WorkerError], what: str) -> WorkerError:
        """End the worker; the error for it, which is the first reason that anybody gave."""
        self._give_reason(kind, what)
        tail = self.launch.log_tail()
        self.kill()
        assert self._reason is not None
        kind, what = self._reason
        return kind(what, self.where, tail)

    def _give_reason(self, kind: type[WorkerError], what: str) -> None:
        with self._lock:
            self._reason = self._reason or (kind, what)

    def kill_for_memory(self, used_mb: float, limit_mb: float) -> None:
        """End a worker that eats memory; the request under way raises `OutOfMemory`."""
        self._give_reason(
            OutOfMemory,
            f"the worker used {used_mb:.0f} MB of memory, more than the limit of {limit_mb:.0f} MB "
            "(--sim-memory-limit), and was killed",
        )
        self.kill()

    def interrupt(self) -> None:
        """End the worker from another thread; the request under way raises `Interrupted`."""
        self._give_reason(Interrupted, "the run was interrupted")
        self.kill()

    @property
    def alive(self) -> bool:
        """Whether the worker can take a request."""
        if self._ended or self._connection.unread:
            return False
        popen = self._connection.popen
        return popen is None or popen.poll() is None

    def close(self, timeout: float = CLOSE_TIMEOUT) -> str | None:
        """End the worker; returns what went wrong while closing, which fails nothing."""
        problem = None
        self.deadline = None
        self._know_family()
        try:
            self.request("close", timeout=timeout)
            if self._connection.popen is not None and self._connection.status(timeout) is None:
                problem = "the worker did not end by itself"
        except WorkerHung:
            problem = f"the worker did not close within {timeout:g} s"
        except WorkerError as error:
            problem = error.what
        self.kill()
        return problem

    def kill(self) -> None:
        """End the worker and all that it started at once; from any thread, again and again."""
        if self._ended:
            return
        reaper.reap(self._mark)
        for process in self._family:
            with contextlib.suppress(psutil.Error):
                process.kill()
        self._connection.cut()
        self._connection.close()
        self.launch.shorten_log()
        if self._temporary is not None:
            shutil.rmtree(self._temporary, ignore_errors=True)
        self._ended = True

    def _know_family(self) -> None:
        """Note the worker's descendants, before it ends by itself and is theirs no longer."""
        popen = self._connection.popen
        if popen is not None:
            with contextlib.suppress(psutil.Error):
                self._family |= reaper.descendants([psutil.Process(popen.pid)])


def _another_release(simulator: str, versions: Mapping[str, str]) -> str:
    """That an engine is of another version than its simulator's name says, whichever interpreter
    or host it is in; empty if it is not, and where it does not tell."""
    name = VersionedName.of(simulator)
    if name.kind != RELEASE:
        return ""
    distribution = adapter(simulator).info.distribution
    found = versions.get(distribution)
    if found is None or canonicalize_version(found) == canonicalize_version(name.which):
        return ""
    return (
        f"{simulator} was asked for, and the worker's interpreter has {distribution} {found}; name "
        f"one that has {name.which}, or write {name.base}@PYTHON to call it by what it has"
    )
