"""The life of another program: its start, waits that end, its last words, the end of its group.

`external` is the base of adapters whose simulator is such a program.
"""

from __future__ import annotations

import math
import os
import select
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from pytest_simbench.simulator.errors import SimulatorError

GUARD = 'read -r line; kill -s KILL -- "-$1"; rm -rf -- "$2"'
"""Waits in a shell for the end of this process, which closes a pipe, however it ends."""

LOOK_PERIOD = 0.05
"""Wall time between two looks at a program that is waited for [s]."""

LAST_BYTES = 2000
"""Of a program's output are kept for messages."""

LAST_WORDS = 1.0
"""Wall time that the output of a program which ended may take to arrive [s]."""


class Program:
    """Another program, from its start to the end of its whole process group.

    It inherits this process's environment, and with it the mark by which the client finds and ends
    all that a run started (`client/reaper.py`). It runs in a session of its own, so that Ctrl-C
    reaches it through this process alone. A shell kills its group when this process is gone,
    SIGKILL included: so nothing is left on hosts that no client looks after either.

    Args:
        title: for messages.
        command: the program and its arguments.
        folder: in which it runs; it is removed when this process is gone.
        environment: variables beside this process's own.
        log: descriptor to which its output goes, both streams; that of this process's errors,
            which is the log in a worker.

    Raises:
        SimulatorError: it cannot be started.
    """

    def __init__(
        self,
        title: str,
        command: Sequence[str],
        folder: Path,
        environment: Mapping[str, str] | None = None,
        log: int = 2,
    ) -> None:
        self.title, self._log = title, log
        self._said, self._how = b"", ""
        self._deadline, self._overdue = math.inf, False
        self._silent, self._over = threading.Event(), threading.Event()
        try:
            self._process = subprocess.Popen(
                list(command),
                cwd=folder,
                env={**os.environ, **(environment or {})},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        except OSError as error:
            raise SimulatorError(f"{title} cannot be started: {error}") from error
        self.pid = self._process.pid
        self._guard = subprocess.Popen(
            ["/bin/sh", "-c", GUARD, "simbench-guard", str(self.pid), str(folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        self._attendant = threading.Thread(target=self._attend, daemon=True)
        self._attendant.start()

    @contextmanager
    def within(self, seconds: float, doing: str) -> Iterator[None]:
        """Have something done with the program, which is killed if that takes longer.

        So a call of a client library that waits for ever comes back, with the end of its
        connection.

        Args:
            seconds: wall time [s].
            doing: for the message, "loading the world".

        Raises:
            SimulatorError: it took longer, the program ended, or what was done raised something
                else than this. The message has the program's last words.
        """
        outer = self._deadline
        self._deadline = min(outer, time.monotonic() + seconds)
        try:
            yield
            if self._overdue:
                raise TimeoutError
        except SimulatorError:
            raise
        except Exception as error:
            what = self._failure(error, seconds)
            raise SimulatorError(f"{self.title} {what} while {doing}; {self.words()}") from error
        finally:
            self._deadline = outer

    def wait_until(self, ready: Callable[[], bool], seconds: float) -> None:
        """Wait until the program is ready, or answers.

        Args:
            ready: whether it is; asked again and again.
            seconds: wall time [s].

        Raises:
            SimulatorError: as of `within`.
        """
        with self.within(seconds, "starting"):
            while not ready():
                if self.ended():
                    raise ChildProcessError
                time.sleep(LOOK_PERIOD)

    def ended(self) -> str:
        """How it ended, "exited with status 3" or "was killed by SIGSEGV"; empty while it runs."""
        if not self._how:  # WNOWAIT: until the group is gone nobody else shall get its number
            found = os.waitid(os.P_PID, self.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT)
            if found is None:
                return ""
            if found.si_code == os.CLD_EXITED:
                self._how = f"exited with status {found.si_status}"
            else:
                self._how = f"was killed by {signal_name(found.si_status)}"
        return self._how

    def words(self) -> str:
        """The last of its output, as the end of a sentence."""
        if self.ended():
            self._silent.wait(LAST_WORDS)
        said = " ".join(self._said.decode("utf-8", "replace").split())
        return f"its last words: {said}" if said else "it wrote nothing"

    def kill(self) -> None:
        """End its process group at once."""
        with suppress(ProcessLookupError):
            os.killpg(self.pid, signal.SIGKILL)

    def end(self, ask: Callable[[], None], seconds: float) -> None:
        """Ask it to end, and kill what is left of its group after so much wall time [s]."""
        if self._over.is_set():
            return
        if not self.ended():
            with suppress(SimulatorError), self.within(seconds, "ending"):
                with suppress(Exception):  # whatever it says, it shall end
                    ask()
                while not self.ended():
                    time.sleep(LOOK_PERIOD)
        self.kill()
        assert self._guard.stdin is not None
        self._guard.stdin.close()
        self._guard.wait()
        while not self.ended():
            time.sleep(LOOK_PERIOD)
        self._process.wait()
        self._over.set()
        self._attendant.join()

    def _failure(self, error: Exception, seconds: float) -> str:
        """What happened, as the middle of a sentence."""
        if self._overdue:
            return f"did not answer within {seconds:g} s and was killed"
        until = time.monotonic() + LAST_WORDS
        while not self.ended() and isinstance(error, OSError | EOFError):  # its end may be near
            if time.monotonic() > until:
                break
            time.sleep(LOOK_PERIOD)
        return self.ended() or f"was not understood ({type(error).__name__}: {error})"

    def _attend(self) -> None:
        """In a thread: take the output, and kill the program when its time is over."""
        assert self._process.stdout is not None
        pipe = self._process.stdout.fileno()
        poll = select.poll()
        poll.register(pipe, select.POLLIN)
        while True:
            over = self._over.is_set()
            if poll.poll(0 if over else 1e3 * LOOK_PERIOD):
                data = os.read(pipe, 1 << 16)
                self._said = (self._said + data)[-LAST_BYTES:]
                with suppress(OSError):  # a full disk
                    os.write(self._log, data)
                if not data:
                    poll.unregister(pipe)
                    self._silent.set()
            elif over:
                return
            if time.monotonic() > self._deadline:
                self._overdue = True
                self.kill()


def signal_name(number: int) -> str:
    """SIGSEGV, for instance."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
