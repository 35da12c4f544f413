"""The first code that runs in a worker's interpreter; its source is sent there by execnet.

It may import nothing but the standard library: the interpreter may be one in which neither pytest
nor this package is installed. It sends all output to the log file, makes this package importable
from the folders that the client names (and nothing else from there), and serves requests.
"""

import ctypes
import faulthandler
import gc
import importlib.util
import io
import os
import queue
import signal
import sys
import tempfile
import time
from importlib.machinery import ModuleSpec
from typing import Any

PR_SET_CHILD_SUBREAPER = 36
"""Of Linux, `man prctl`: children of children that lost their parent become ours."""

GONE = object()
"""In place of a request: the client is gone."""

GRACE = 5.0
"""For the client, or its reaper, to end this process [s]: they find our children through us."""


class PackageFinder:
    """Finds just the named packages, wherever they lie.

    Putting the client's site-packages on sys.path would mix two environments; this does not.
    """

    def __init__(self, locations: dict[str, str]) -> None:
        self.locations = locations

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        location = self.locations.get(name)
        if location is None:
            return None
        folders = [os.path.dirname(location)] if location.endswith("__init__.py") else None
        return importlib.util.spec_from_file_location(
            name, location, submodule_search_locations=folders
        )


class LogFile(io.FileIO):
    """A file that takes what a full disk does not: a log must not end a repetition."""

    def write(self, data: Any) -> int:
        try:
            return super().write(data)
        except OSError:
            return len(data)


def log_stream(descriptor: int) -> io.TextIOWrapper:
    """A text stream on stdout or stderr that raises nothing, whatever is written."""
    raw = LogFile(descriptor, "w", closefd=False)
    return io.TextIOWrapper(
        io.BufferedWriter(raw), "utf-8", errors="backslashreplace", line_buffering=True
    )


def redirect_output(path: str) -> None:
    """Send stdout and stderr, also those of C code, to the log file."""
    log = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    sys.stdout.flush()
    sys.stderr.flush()
    os.dup2(log, 1)
    os.dup2(log, 2)
    os.close(log)
    sys.stdout, sys.stderr = log_stream(1), log_stream(2)
    faulthandler.enable(file=sys.stderr)


def adopt_orphans() -> None:
    """Stay the ancestor of all that the engine starts, so that the client finds and ends it."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def requests_of(channel: Any) -> "queue.SimpleQueue[Any]":
    """The client's requests. The process ends with its connection, whatever it is doing then."""
    requests: queue.SimpleQueue[Any] = queue.SimpleQueue()

    def take(request: Any) -> None:  # in execnet's thread
        if request is GONE:
            time.sleep(GRACE)
            os._exit(1)
        requests.put(request)

    channel.setcallback(take, endmarker=GONE)
    return requests


def main(channel: Any) -> None:
    # Ctrl-C goes to the whole process group; the client decides what becomes of its workers.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    config = channel.receive()
    folder, log = config["folder"], config["log"]
    if folder and not os.path.isdir(folder):  # another host
        folder = tempfile.mkdtemp(prefix="simbench-")
        log = os.path.join(folder, os.path.basename(log))
    if log:
        redirect_output(log)
    sys.path[:] = [entry for entry in sys.path if entry not in ("", os.getcwd())]
    if folder:
        os.chdir(folder)  # engines leave logs and caches where they run
    sys.meta_path.insert(0, PackageFinder(config["packages"]))
    adopt_orphans()

    gc.disable()  # what is imported stays: to look for garbage meanwhile takes a twentieth longer
    from pytest_simbench.worker.server import serve

    serve(requests_of(channel).get, channel.send, config["exchange"])
    # Windows and engines may crash while the interpreter tears them down; everything is sent.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)


if __name__ == "__channelexec__":
    main(channel)  # type: ignore[name-defined]  # noqa: F821 - execnet provides it
