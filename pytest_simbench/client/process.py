"""A worker's process, started through execnet: requests, time-outs, death. Knows execnet alone."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import shlex
import sys
import threading
import time
import uuid
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import execnet
import psutil

from pytest_simbench import __version__
from pytest_simbench.client import bootstrap
from pytest_simbench.client.errors import (
    REMOTE_ERRORS,
    EngineFailed,
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
from pytest_simbench.worker.wire import pack, unpack

TOKEN = "PYTEST_SIMBENCH_WORKER"
"""Environment variable by which a worker's process is found before it has told its pid."""

IGNORING_INTERRUPTS = ("sh", "-c", 'trap "" INT; exec "$@"', "sh")
"""Prefix of a worker's command. Ctrl-C reaches the whole process group, also a worker that is just
starting; its death would be recorded as a failure of its own before the client can intervene."""

LOG_TAIL_LINES = 30


@dataclass(frozen=True)
class Launch:
    """How to start a worker.

    Attributes:
        adapter: `module:Class` of the simulator's adapter.
        python: interpreter, None for pytest's own.
        spec: whole execnet specification, which overrides `python` (another host).
        environment: variables set in the worker's environment.
        log: file that takes all of the worker's output, None to leave it alone.
        start_timeout: for interpreter start and handshake [s].
        stall_timeout: longest silence before the worker counts as hung [s].
        compile_timeout: for `Simulator.compile` [s]; 0 where there is nothing to compile.
    """

    adapter: str
    python: str | None = None
    spec: str | None = None
    environment: Mapping[str, str] = field(default_factory=dict)
    log: Path | None = None
    start_timeout: float = 60.0
    stall_timeout: float = 60.0
    compile_timeout: float = 0.0


class WorkerProcess:
    """One worker, from its start to its end.

    Attributes:
        pid: of the worker's process; of its host when that is another one.
        where: kept up to date by the owner; every error carries it.
        deadline: `time.monotonic()` at which the repetition times out, None for never.
        busy: a request was sent and its answer not received; after an exception from elsewhere
            (Ctrl-C, a time-out of the test) the next answer would be the wrong one.
    """

    def __init__(self, launch: Launch, where: Where) -> None:
        self.launch = launch
        self.where = where
        self.deadline: float | None = None
        self.busy = False
        self.pid: int | None = None
        self._process: psutil.Process | None = None
        self._killed: tuple[type[WorkerError], str] | None = None
        self._token = uuid.uuid4().hex
        self._group = execnet.Group()
        self._gateway, self._channel = self._start()
        hello = self.request("hello", timeout=launch.start_timeout)
        self.pid = hello["pid"]
        self.python_version: str = hello["python"]
        if hello["version"] != __version__:
            self.kill()
            raise WorkerStartError(
                f"the worker runs pytest-simbench {hello['version']}, this is {__version__}; "
                "install the same version on both sides",
                where,
            )

    def _start(self) -> tuple[Any, Any]:
        """Start the interpreter. execnet's own start has no time-out, so it runs in a thread."""
        made: list[Any] = []
        failed: list[BaseException] = []

        def start() -> None:
            try:
                gateway = self._group.makegateway(self._spec())
                channel = gateway.remote_exec(bootstrap)
                channel.send(self._configuration())
                made.append((gateway, channel))
            except BaseException as error:
                failed.append(error)

        thread = threading.Thread(target=start, name="simbench-launch", daemon=True)
        thread.start()
        thread.join(self.launch.start_timeout)
        self._process = self._find_process()
        if made:
            return made[0]  # type: ignore[no-any-return]
        self._kill_tree()
        if self._process is not None:
            with contextlib.suppress(psutil.Error):
                self._process.wait(1.0)
        interpreter = self.launch.spec or self.launch.python or "this interpreter"
        if failed:
            reason = f"{type(failed[0]).__name__}: {failed[0]}"
        else:
            reason = f"no handshake within {self.launch.start_timeout:g} s"
        raise WorkerStartError(
            f"cannot start a worker with {interpreter} ({reason}); check the path given "
            "with --sim-python or --sim-spec: it must be a Python interpreter with the engine "
            "and numpy, printing nothing of its own",
            self.where,
            self.log_tail(),
        )

    def _spec(self) -> str:
        if self.launch.spec:
            return self.launch.spec
        # Not execnet's own `env:`, which is set only once the interpreter answers.
        variables = {**self.launch.environment, TOKEN: self._token}
        command = [*IGNORING_INTERRUPTS, "env"]
        command += [f"{key}={value}" for key, value in variables.items()]
        command.append(self.launch.python or sys.executable)
        return f"popen//execmodel=main_thread_only//python={shlex.join(command)}"

    def _configuration(self) -> dict[str, Any]:
        log = self.launch.log
        return {
            "log": str(log or ""),
            "folder": str(log.parent.absolute()) if log and log.parent != Path("/dev") else "",
            "packages": self._packages(),
        }

    def _packages(self) -> dict[str, str]:
        """Where the packages that the worker needs lie: this one, the adapters, a third party's."""
        if self.launch.spec and not self.launch.spec.startswith("popen"):
            return {}  # another host has its own installation
        names = {"pytest_simbench", "pytest_simbench.sims"}
        names.add(self.launch.adapter.partition(":")[0].split(".")[0])
        specs = {name: importlib.util.find_spec(name) for name in names}
        return {name: s.origin for name, s in specs.items() if s is not None and s.origin}

    def _find_process(self) -> psutil.Process | None:
        # Until `env` has become the interpreter, the token stands in its arguments.
        argument = f"{TOKEN}={self._token}"
        for child in psutil.Process().children(recursive=True):
            with contextlib.suppress(psutil.Error):
                if child.environ().get(TOKEN) == self._token or argument in child.cmdline():
                    return child
        return None

    def request(self, operation: str, *, timeout: float | None = None, **arguments: Any) -> Any:
        """Send one request and wait for its answer.

        Args:
            operation: of `worker.server.Server`.
            timeout: for the whole request [s]; silence ends it after `stall_timeout` anyway,
                unless the timeout is longer than that.

        Raises:
            WorkerError: one of its kinds; the worker is dead then, unless it is `EngineFailed`.
        """
        started = time.monotonic()
        self.busy = True
        try:
            self._channel.send({"op": operation, **pack(arguments)})
        except OSError:
            raise self._exited() from None
        while True:
            answer = self._receive(started, timeout)
            if not isinstance(answer, dict):
                self.kill()
                raise ProtocolError(
                    f"unreadable answer {answer!r:.80}", self.where, self.log_tail()
                )
            if "alive" in answer:
                continue
            self.busy = False
            if "error" in answer:
                raise self._remote_error(answer["error"])
            return unpack(answer["ok"])

    def _receive(self, started: float, timeout: float | None) -> Any:
        silence = max(self.launch.stall_timeout, timeout or 0.0)
        now = time.monotonic()
        limits: list[tuple[float, Callable[[], WorkerError]]] = [(now + silence, self._hung)]
        if timeout is not None:
            limits.append((started + timeout, self._hung))
        if self.deadline is not None:
            limits.append((self.deadline, self._timed_out))
        until, error = min(limits, key=lambda limit: limit[0])
        try:
            return self._channel.receive(timeout=max(0.001, until - now))
        except self._channel.TimeoutError:
            raise error() from None
        except EOFError:
            raise self._exited() from None
        except self._channel.RemoteError as remote:
            tail = self.log_tail() or str(remote)[-2000:]
            self.kill()
            raise WorkerStartError("the worker failed to start", self.where, tail) from None

    def _remote_error(self, error: dict[str, str]) -> WorkerError:
        kind = REMOTE_ERRORS.get(error["type"], EngineFailed)
        return kind(error["message"], self.where, self.log_tail())

    def _hung(self) -> WorkerError:
        tail = self.log_tail()
        self.kill()
        return WorkerHung(
            "the worker gave no sign of life and was killed; raise the ini option "
            f"sim_stall_timeout if the engine is only slow (now {self.launch.stall_timeout:g} s)",
            self.where,
            tail,
        )

    def _timed_out(self) -> WorkerError:
        tail = self.log_tail()
        self.kill()
        return RepetitionTimeout(
            "the repetition took longer than its time-out and was ended; raise --sim-timeout if "
            "the simulator is only slow",
            self.where,
            tail,
        )

    def _exited(self) -> WorkerError:
        code = self._exit_code()
        self.kill()
        if self._killed is not None:
            kind, what = self._killed
            return kind(what, self.where, self.log_tail())
        return WorkerExited(f"the worker {exit_text(code)}", self.where, self.log_tail())

    def _exit_code(self) -> int | None:
        # The pipe breaks a moment before the process can be waited for.
        popen = getattr(getattr(self._gateway, "_io", None), "popen", None)
        if popen is None:
            return None
        try:
            code: int | None = popen.wait(timeout=5)
        except Exception:
            return None
        return code

    def log_tail(self) -> str:
        """The last lines of the worker's log."""
        if self.launch.log is None or not self.launch.log.is_file():
            return ""
        with self.launch.log.open("rb") as log:
            log.seek(max(0, os.fstat(log.fileno()).st_size - 8192))
            text = log.read().decode("utf-8", "replace")
        return "\n".join(text.splitlines()[-LOG_TAIL_LINES:])

    def kill_for_memory(self, used_mb: float, limit_mb: float) -> None:
        """End a worker that eats memory; the request under way raises `OutOfMemory`."""
        self._killed = (
            OutOfMemory,
            f"the worker used {used_mb:.0f} MB of memory, more than the limit of {limit_mb:.0f} MB "
            "(--sim-memory-limit), and was killed",
        )
        self._kill_tree()

    @property
    def alive(self) -> bool:
        """Whether the worker's process still runs."""
        return self._process is not None and self._process.is_running()

    def close(self, timeout: float = 10.0) -> str | None:
        """End the worker; returns what went wrong while closing, which fails nothing."""
        problem = None
        try:
            self.request("close", timeout=timeout)
            if self._process is not None:
                self._process.wait(timeout)
        except (WorkerError, psutil.TimeoutExpired) as error:
            problem = getattr(error, "what", None) or "the worker did not end by itself"
        self.kill()
        return problem

    def kill(self) -> None:
        """End the worker and all its children at once."""
        self._kill_tree()
        # execnet would wait for goodbyes; the process is gone, so only its threads are reaped.
        with contextlib.suppress(Exception):
            self._group.terminate(timeout=0.5)

    def _kill_tree(self) -> None:
        if self._process is None:
            return
        tree = [self._process]
        with contextlib.suppress(psutil.Error):
            tree += self._process.children(recursive=True)
        for process in tree:
            with contextlib.suppress(psutil.Error):
                process.kill()
