"""execnet's channel to a worker, without its waits: whatever the other side does, none is for ever.

execnet starts, sends and says goodbye without a time-out: a worker that is stopped, or that holds
its interpreter's lock, blocks the caller in the pipe as soon as the pipe is full. Here another
thread does that, and the caller waits for one thing only, the inbox, for as long as it likes.
Ending the process breaks the pipes and so frees the threads.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import shlex
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from queue import Empty, SimpleQueue
from types import ModuleType, SimpleNamespace
from typing import Any

import execnet
from execnet.gateway_base import ThreadExecModel

from pytest_simbench.worker.wire import Frames

RemoteError = execnet.RemoteError
"""An exception out of the module that runs there, as text."""

OPENED = object()
"""The first message of a connection that could be opened."""

_END = object()

BOOTSTRAP = "import sys;exec("
"""How execnet's text for an interpreter begins, on this machine and through ssh."""

SAFE = "import sys;sys.path[:1]=filter(None,sys.path[:1]);exec("
"""The same without the folder where the interpreter stands, like the option -P."""

MOST_WAITING = 16
"""Messages that may wait to be read. A worker answers one request at a time: more is a flood."""

CALM = {"OPENBLAS_THREAD_TIMEOUT": "4"}
"""numpy's threads sleep when they are done, not 30 ms later: who steps next would pay for that."""

GOODBYE_TIMEOUT = 0.5
"""For execnet's threads to notice that the process is gone [s]; what is left is left to itself."""


def elsewhere(spec: str | None) -> bool:
    """Whether an execnet specification is for another host, or a process that is not ours."""
    return spec is not None and not spec.startswith("popen")


class _Threads(ThreadExecModel):
    """execnet's threads, with a process started our way."""

    def __init__(self, popen: Callable[..., Any]) -> None:
        self._popen = popen

    @property
    def subprocess(self) -> Any:
        return SimpleNamespace(PIPE=subprocess.PIPE, Popen=self._popen)


class Connection:
    """To one worker. Each method returns at once, or after its time-out.

    Args:
        spec: execnet specification, or None to start `python` on this machine.
        python: interpreter, if there is no specification; None for this one.
        environment: variables of the process, beside this one's.
        log: file for what the process says before it can see to that itself; None for our stderr.

    Attributes:
        exchange: a socket to the process on this machine, for questions that cannot wait for
            execnet's threads: four of them take part in one, and use 0.4 ms in place of 0.1.
        popen: the process on this machine (of ssh, for another host); None before it is started,
            and for a socket.
        heard: `time.monotonic()` of the last sign of life.
        on_frame: takes the frames of a film, in execnet's thread: a worker that draws faster than
            they are taken waits. None: nobody asked for any.
    """

    def __init__(
        self, spec: str | None, python: str | None, environment: Mapping[str, str], log: Path | None
    ) -> None:
        self.popen: subprocess.Popen[bytes] | None = None
        self.heard = time.monotonic()
        self.on_frame: Callable[[Any], None] | None = None
        self._environment = environment
        self._log = log
        self._inbox: SimpleQueue[Any] = SimpleQueue()
        self._outbox: SimpleQueue[Any] = SimpleQueue()
        self._channel: Any = None
        self._cut = False
        self.exchange: Frames | None = None
        self._theirs: socket.socket | None = None
        if not elsewhere(spec):
            ours, self._theirs = socket.socketpair()
            self.exchange = Frames(ours)
        self._spec = execnet.XSpec(spec or "popen//execmodel=main_thread_only")
        if not spec:  # not in the text, where a // in a path would end it
            self._spec.python = shlex.quote(python or sys.executable)
        threads: Any = _Threads(self._start)  # a name or a model, though declared as a name
        self._group = execnet.Group(execmodel=threads)
        atexit.unregister(self._group._cleanup_atexit)  # it may block, and keeps the group for ever

    def open(self, module: ModuleType, configuration: dict[str, Any]) -> None:
        """Begin to start the process and to run a module there; `receive` gives OPENED then."""

        def work() -> None:
            try:
                gateway = self._group.makegateway(self._spec)
                channel = gateway.remote_exec(module)
                channel.setcallback(self._arrived, endmarker=_END)
                channel.send(configuration)
                self._channel = channel
                self._inbox.put(OPENED)
                while (message := self._outbox.get()) is not _END:
                    channel.send(message)
            except BaseException as error:
                lost = self._channel is not None and isinstance(error, OSError)
                self._inbox.put(_END if lost else error)

        threading.Thread(target=work, name="simbench-connection", daemon=True).start()

    @property
    def descriptor(self) -> int | None:
        """Of the process's end of `exchange`, there."""
        return None if self._theirs is None else self._theirs.fileno()

    def _start(self, command: list[str], **pipes: Any) -> subprocess.Popen[bytes]:
        """Called by execnet, in the thread of `open`."""
        # What lies where pytest was started must not hide modules, nor can -P be said to a Python
        # before 3.11: the text that it runs drops its path's first entry before it imports.
        command = [part.replace(BOOTSTRAP, SAFE) for part in command]
        with contextlib.ExitStack() as stack:
            if self._log is not None:
                with contextlib.suppress(OSError):  # a full disk must not stop the worker
                    pipes["stderr"] = stack.enter_context(self._log.open("ab"))
            # A session of its own: Ctrl-C is for pytest, which decides what becomes of workers.
            if self._theirs is not None:
                pipes["pass_fds"] = (stack.enter_context(self._theirs).fileno(),)
            variables = {**CALM, **os.environ, **self._environment}
            self.popen = subprocess.Popen(command, env=variables, start_new_session=True, **pipes)
        if self._cut:  # meanwhile
            self.popen.kill()
        return self.popen

    def _arrived(self, message: Any) -> None:
        """Called by execnet's thread with each message."""
        if isinstance(message, dict) and "alive" in message:
            self.heard = time.monotonic()
        elif self.on_frame is not None and isinstance(message, dict) and "frame" in message:
            self.on_frame(message["frame"])
            self.heard = time.monotonic()
        elif message is _END or self._inbox.qsize() < MOST_WAITING:
            self.heard = time.monotonic()
            self._inbox.put(message)

    def send(self, message: Any) -> None:
        """Begin to send plain data; if that fails, `receive` says so."""
        self._outbox.put(message)

    def take(self, timeout: float) -> Any:
        """The next message, where it may be a question: bytes, through `exchange` if there is one;
        errors as `receive`. There stands the mark that no question follows, even where the answer
        is here already: left unread, it would come before the next loop's first question."""
        if self.exchange is None:
            return self.receive(timeout)
        try:
            found = self.exchange.receive(timeout)
        except TimeoutError:
            if self._inbox.empty():
                raise
            found = None
        except OSError:
            found = None
        self.heard = time.monotonic()
        return self.receive(timeout) if found is None else found  # no question: the answer comes

    def reply(self, data: bytes | None) -> None:
        """Answer a question; None: no more of them."""
        if self.exchange is None:
            self.send(data)
            return
        with contextlib.suppress(OSError):  # `receive` tells
            self.exchange.send(data or b"")

    @property
    def unread(self) -> bool:
        """Whether a message waits."""
        return not self._inbox.empty()

    def receive(self, timeout: float) -> Any:
        """The next message.

        Raises:
            TimeoutError: none came within `timeout` [s].
            EOFError: the connection is broken.
            Exception: what went wrong while starting or sending, or an exception out of the module
                there, as execnet's RemoteError.
        """
        try:
            message = self._inbox.get(timeout=timeout)
        except Empty:
            raise TimeoutError from None
        if message is _END:
            self._inbox.put(_END)
            if self._channel is not None:
                with contextlib.suppress(OSError):  # the reason follows the end mark
                    self._channel.waitclose(GOODBYE_TIMEOUT)
            raise EOFError
        if isinstance(message, BaseException):
            raise message
        return message

    def status(self, timeout: float) -> int | None:
        """Exit status of the process; None if it still runs after `timeout` [s]."""
        try:
            return None if self.popen is None else self.popen.wait(timeout)
        except subprocess.TimeoutExpired:
            return None

    def cut(self) -> None:
        """End the process, also one that is just being started; whoever receives is told."""
        self._cut = True
        if self.popen is not None:
            with contextlib.suppress(OSError):
                self.popen.kill()
        self._inbox.put(_END)
        self._outbox.put(_END)

    def close(self) -> None:
        """Let execnet tidy up, once the process is gone."""

        for end in (self.exchange, self._theirs):
            if end is not None:
                end.close()

        def work() -> None:
            with contextlib.suppress(Exception):
                self._group.terminate(timeout=GOODBYE_TIMEOUT)
            with contextlib.suppress(Exception):  # takes an error that execnet would print else
                self._channel.waitclose(GOODBYE_TIMEOUT)

        self.status(GOODBYE_TIMEOUT)
        thread = threading.Thread(target=work, name="simbench-close", daemon=True)
        thread.start()
        thread.join(4 * GOODBYE_TIMEOUT)
