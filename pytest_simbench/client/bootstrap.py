"""The first code that runs in a worker's interpreter; its source is sent there by execnet.

It may import nothing but the standard library: the interpreter may be one in which neither pytest
nor this package is installed. It sends all output to the log file, makes this package importable
from the folders that the client names (and nothing else from there), and serves requests.
"""

import faulthandler
import importlib.util
import os
import signal
import sys
import tempfile
from importlib.machinery import ModuleSpec
from typing import Any


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


def redirect_output(path: str) -> None:
    """Send stdout and stderr, also those of C code, to the log file."""
    log = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    sys.stdout.flush()
    sys.stderr.flush()
    os.dup2(log, 1)
    os.dup2(log, 2)
    sys.stdout = os.fdopen(1, "w", buffering=1, errors="replace", closefd=False)
    sys.stderr = os.fdopen(2, "w", buffering=1, errors="replace", closefd=False)
    faulthandler.enable(file=sys.stderr)


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

    from pytest_simbench.worker.server import serve

    serve(channel.receive, channel.send)
    # Windows and engines may crash while the interpreter tears them down; everything is sent.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)


if __name__ == "__channelexec__":
    main(channel)  # type: ignore[name-defined]  # noqa: F821 - execnet provides it
