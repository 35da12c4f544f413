"""A display for GUI mode: the user's own, else a virtual one."""

from __future__ import annotations

import contextlib
import os
import select
import shutil
import subprocess
import threading
import time
from collections.abc import Mapping

from pytest_simbench.client import reaper
from pytest_simbench.client.errors import DisplayError, exit_text

SCREEN = "1280x960x24"
"""Width, height [pixels] and colour depth [bits]."""

OPTIONS = ("-screen", "0", SCREEN, "-nolisten", "tcp", "-noreset")
"""Of Xvfb. Without ``-noreset`` it begins anew when its last client leaves, and refuses a client
that comes meanwhile. A Vulkan driver looks at the display and leaves just before the engine
comes."""

START_TIMEOUT = 30.0
"""For Xvfb to tell the number of its display [s]; it takes about 0.1 s."""

STOP_TIMEOUT = 2.0
"""For Xvfb to be gone once it is killed [s]."""


class Displays:
    """Hands out the display of a session, starting a virtual one when there is none.

    A virtual one that ended is replaced by another when the next worker needs it. It ends with
    this process, however that ends.
    """

    def __init__(self) -> None:
        self._virtual: dict[str, subprocess.Popen[bytes]] = {}
        self._lock = threading.Lock()

    def environment(self) -> dict[str, str]:
        """Variables that a worker with a window needs.

        Raises:
            DisplayError: there is no display, and none can be started.
        """
        if os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
            return {}
        with self._lock:
            for name, process in self._virtual.items():
                if process.poll() is None:
                    return {"DISPLAY": name}
            name, process = _start()
            self._virtual[name] = process
            return {"DISPLAY": name}

    def problem(self, environment: Mapping[str, str]) -> str:
        """Why the virtual display of this environment is no longer there, or nothing."""
        process = self._virtual.get(environment.get("DISPLAY", ""))
        if process is None or process.poll() is None:
            return ""
        name = environment["DISPLAY"]
        return f"the virtual display {name} (Xvfb) {exit_text(process.returncode)}"

    def close(self) -> None:
        """Stop the virtual displays, if any were started."""
        with self._lock:
            while self._virtual:
                _, process = self._virtual.popitem()
                _end(process)


def _start() -> tuple[str, subprocess.Popen[bytes]]:
    """An Xvfb on a display that it chose itself."""
    program = shutil.which("Xvfb")
    if program is None:
        raise DisplayError("no display, and no Xvfb for a virtual one: apt-get install xvfb")
    read, write = os.pipe()
    try:
        # A session of its own: Ctrl-C is for pytest.
        process = subprocess.Popen(
            [program, "-displayfd", str(write), *OPTIONS],
            pass_fds=[write],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env={**os.environ, reaper.VARIABLE: reaper.new_mark()},
            start_new_session=True,
        )
        os.close(write)
        write = -1
        number = _line(read, START_TIMEOUT)
    finally:
        for descriptor in (read, write):
            with contextlib.suppress(OSError):
                os.close(descriptor)
    if number.isdecimal():
        return f":{number}", process
    code = process.poll()
    _end(process)
    said = exit_text(code) if code is not None else f"told no display in {START_TIMEOUT:g} s"
    raise DisplayError(f"no display, and Xvfb for a virtual one {said}")


def _line(descriptor: int, timeout: float) -> str:
    """What is written there up to the end of the line, the end of the pipe or of the time [s]."""
    until, text = time.monotonic() + timeout, b""
    while not text.endswith(b"\n") and (left := until - time.monotonic()) > 0:
        if not select.select([descriptor], [], [], left)[0]:
            break
        part = os.read(descriptor, 64)
        if not part:
            break
        text += part
    return text.decode("ascii", "replace").strip()


def _end(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(STOP_TIMEOUT)
