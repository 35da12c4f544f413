"""The base of an adapter whose simulator is a program of its own, stepped in lock-step.

What it would take for the programs that the study compared is in docs/external.md.
"""

from __future__ import annotations

import math
import os
import select
import signal
import subprocess
import tempfile
import threading
import time
from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import ClassVar

from pytest_simbench.ground.errors import SimulatorError
from pytest_simbench.scene import Scene
from pytest_simbench.simulator.base import Simulator

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
        """Wait until the program is ready; it is asked again and again, for so much wall time [s].

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


class ExternalSimulator(Simulator):
    """Base of an adapter of a program that simulates in lock-step.

    The life of the program: `command_line` and `variables` start it in a folder of its own, it is
    waited for until `connect` succeeds, `build` has it build the world, and `ask_to_end` is its
    last call. Each is bounded in time; a program that dies or hangs gives an error with its last
    words. Calls of the program elsewhere (`command`, `body_state`) go into `with self.asking(...)`.

    `step` is `advance(1)`, and `advance` is the barrier: it returns when the program has made so
    many steps, by its own count, and no others.

    Attributes:
        program: that runs; None before `load`.
        folder: the program's, for the world's files.
        scene: that was loaded.
        start_limit, answer_limit, end_limit: wall time for starting and for building the world,
            for any other call, and for ending [s]. The first two are less than the 60 s of silence
            after which the client kills a worker: so the message is the program's own.
    """

    start_limit: ClassVar[float] = 50.0
    answer_limit: ClassVar[float] = 30.0
    end_limit: ClassVar[float] = 5.0

    program: Program | None = None
    _folder: tempfile.TemporaryDirectory[str] | None = None

    @abstractmethod
    def command_line(self) -> Sequence[str]:
        """The program and its arguments; `scene` and `folder` are known."""

    def variables(self) -> Mapping[str, str]:
        """Of the program's environment, beside the worker's."""
        return {}

    @abstractmethod
    def connect(self) -> bool:
        """Whether the program answers by now; called until it does. It is no error that nobody
        listens yet."""

    @abstractmethod
    def build(self, scene: Scene) -> None:
        """Have the program build the world, at time 0.

        Raises:
            SimulatorError: it refuses the world; the message has its own words.
        """

    @abstractmethod
    def make_steps(self, steps: int) -> int:
        """Have the program make so many steps, and return when they are made; the number of steps
        since `build`, by the program's own count or clock."""

    @abstractmethod
    def ask_to_end(self) -> None:
        """Ask the program to end; it is killed if it does not."""

    def load(self, scene: Scene) -> None:
        self.scene, self._steps = scene, 0
        self._folder = tempfile.TemporaryDirectory(
            prefix=f"simbench-{self.info.name}-", ignore_cleanup_errors=True
        )
        self.folder = Path(self._folder.name)
        self.program = program = Program(
            self.info.title, self.command_line(), self.folder, self.variables()
        )
        program.wait_until(self.connect, self.start_limit)
        with program.within(self.start_limit, "building the world"):
            self.build(scene)

    @contextmanager
    def asking(self, doing: str) -> Iterator[None]:
        """Within `answer_limit`; see `Program.within`.

        Raises:
            SimulatorError: as there, or nothing was loaded.
        """
        if self.program is None:
            raise SimulatorError(f"{self.info.title} was not started: no scene was loaded")
        with self.program.within(self.answer_limit, doing):
            yield

    def advance(self, steps: int) -> None:
        """Advance by exactly so many time steps.

        Raises:
            SimulatorError: another number of steps has passed since `load`.
        """
        with self.asking("stepping"):
            passed = self.make_steps(steps)
        self._steps += steps
        if passed != self._steps:
            raise SimulatorError(
                f"{self.info.title} has made {passed} steps and should have made {self._steps}: "
                "its time moves by itself or in other steps, so it is not in lock-step"
            )

    def step(self) -> None:
        self.advance(1)

    def close(self) -> None:
        if self.program is not None:
            self.program.end(self.ask_to_end, self.end_limit)
        if self._folder is not None:
            self._folder.cleanup()
