"""No process outlives its purpose: what a run starts carries a mark, and the marked are ended.

The mark is an environment variable. Children inherit it, so an engine's own children carry it too,
whatever session or parent they gave themselves. `reap` ends all who carry a mark. Run as a script,
this file waits until the process that started it is gone, however it went (SIGKILL as well), and
ends all that it left behind; a program cannot do that for itself.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import uuid
from collections.abc import Iterable
from itertools import count
from pathlib import Path

import psutil

VARIABLE = "PYTEST_SIMBENCH_WORKER"
"""The mark's name. Its value: one for the pytest process, a dot, and a number."""

REAP_TIMEOUT = 5.0
"""Wall time in which the marked must be gone [s]: the kernel ends them within milliseconds, unless
they hang in a driver, and then nobody can end them."""

FOLDERS = "simbench-"
"""Before the mark, in the name of a process's temporary folder."""

PARENT_PERIOD = 1.0
"""Wall time between two looks whether the parent still lives [s]; usually its pipe tells first."""


class _Run:
    """The mark of this process, and the script that waits for its end."""

    def __init__(self) -> None:
        self.pid = os.getpid()
        self.mark = uuid.uuid4().hex
        self.numbers = count(1)
        self._script: subprocess.Popen[bytes] | None = None
        atexit.register(self._dismiss)

    def watch(self) -> None:
        """Have the script run; it is started again if somebody ended it."""
        if self._script is None or self._script.poll() is not None:
            self._script = subprocess.Popen(
                # -P: the names of the modules beside this file must not hide others.
                [sys.executable, "-P", __file__, self.mark],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )
        self._script.send_signal(signal.SIGCONT)  # somebody may have stopped it

    def _dismiss(self) -> None:
        script = self._script
        if script is None or self.pid != os.getpid():
            return
        assert script.stdin is not None
        with contextlib.suppress(OSError):
            script.stdin.close()
        script.send_signal(signal.SIGCONT)
        try:
            script.wait(2 * REAP_TIMEOUT)
        except subprocess.TimeoutExpired:
            script.kill()


_run: _Run | None = None
_lock = threading.Lock()


def new_mark() -> str:
    """A mark for one more process; what carries it ends with this process at the latest."""
    global _run
    with _lock:
        if _run is None or _run.pid != os.getpid():  # after a fork the child is a run of its own
            _run = _Run()
        _run.watch()
        return f"{_run.mark}.{next(_run.numbers)}"


def folder_of(mark: str) -> Path | None:
    """A new folder for the temporary files of what carries the mark; None where none can be made.

    Whoever ends the process removes it. The script removes those of a run that was killed.
    """
    with contextlib.suppress(OSError):
        folder = Path(tempfile.gettempdir(), f"{FOLDERS}{mark}")
        folder.mkdir(0o700)
        return folder
    return None


def marked(mark: str) -> list[psutil.Process]:
    """Living processes that carry this mark, or one derived from it with a dot."""
    found = []
    for process in psutil.process_iter():
        with contextlib.suppress(psutil.Error, OSError):
            value = process.environ().get(VARIABLE, "")
            if value == mark or value.startswith(f"{mark}."):
                found.append(process)
    return found


def descendants(processes: Iterable[psutil.Process]) -> set[psutil.Process]:
    """All living children of children; some may have thrown their mark away."""
    found: set[psutil.Process] = set()
    for process in processes:
        with contextlib.suppress(psutil.Error):
            found.update(process.children(recursive=True))
    return {process for process in found if not _ended(process)}


def _ended(process: psutil.Process) -> bool:
    try:
        return bool(process.status() == psutil.STATUS_ZOMBIE)
    except psutil.Error:
        return True


def reap(mark: str) -> None:
    """End all processes that carry the mark, their descendants, and what they start meanwhile.

    The marked are stopped first, and outlive their descendants: a worker adopts those that lose
    their parent, so while it is there none gets away.
    """
    until = time.monotonic() + REAP_TIMEOUT
    while found := marked(mark):
        for process in found:
            _send(process, signal.SIGSTOP)
        below, late = descendants(found), time.monotonic() > until
        for process in [*below, *found] if late else below or found:
            _send(process, signal.SIGKILL)
        if late:
            return
        time.sleep(0.01)


def _send(process: psutil.Process, number: int) -> None:
    with contextlib.suppress(psutil.Error):
        process.send_signal(number)


def main(mark: str) -> None:
    """Wait for the end of the parent, then reap."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):  # meant for the parent
        signal.signal(number, signal.SIG_IGN)
    parent = os.getppid()
    while os.getppid() == parent:
        readable, _, _ = select.select([0], [], [], PARENT_PERIOD)
        if readable and not os.read(0, 1):
            break
    reap(mark)
    with contextlib.suppress(OSError):
        for folder in Path(tempfile.gettempdir()).glob(f"{FOLDERS}{mark}.*"):
            shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main(sys.argv[1])
