"""Makes the environments of simulators: with uv where it is there, else with venv and pip.

uv is quick, and environments share what they have in common in its cache. It is told what pip is
configured with, so that both ask the same package index.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from pytest_simbench.client.package_index import pip_configuration
from pytest_simbench.records.paths import opened
from pytest_simbench.simulator.errors import SimulatorError

LOOK_PERIOD = 0.5
"""Between two looks at what is there already [s]."""

UV_VARIABLES = {
    "index-url": "UV_DEFAULT_INDEX",
    "extra-index-url": "UV_INDEX",
    "find-links": "UV_FIND_LINKS",
    "cert": "SSL_CERT_FILE",
}
"""uv's names for what pip's configuration says."""

Tell = Callable[[str], None]


def uv() -> str | None:
    """The program uv: on the PATH, or beside this interpreter."""
    beside = Path(sys.executable).with_name("uv")
    return str(beside) if os.access(beside, os.X_OK) else shutil.which("uv")


@contextmanager
def alone(folder: Path, tell: Tell) -> Iterator[None]:
    """Only one process makes an environment at a time; another one waits until that is done.

    The lock ends with its process, however that ends.

    Raises:
        SimulatorError: their folder cannot be written to.
    """
    try:
        lock = opened(folder.parent, f".{folder.name}.lock", os.O_RDWR | os.O_CREAT)
    except OSError as error:
        raise SimulatorError(
            f"environments cannot be made in {folder.parent} ({error.strerror})"
        ) from None
    try:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            tell(f"another run is making the environment {folder.name}; waiting for it\n")
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield
    finally:
        os.close(lock)


def install(folder: Path, requirements: Sequence[str], tell: Tell) -> None:
    """Make a virtual environment anew with these packages.

    Args:
        folder: of the environment; what is there is lost.
        requirements: for pip.
        tell: shows progress, a line without its end.

    Raises:
        SimulatorError: the packages do not install; the message ends with what the program said.
    """
    if folder.exists():
        shutil.rmtree(folder)
    python, program = str(folder / "bin" / "python"), uv()
    if program is not None:
        variables = _as_uv(pip_configuration())
        commands = [
            [program, "venv", "--quiet", "--python", sys.executable, str(folder)],
            [program, "pip", "install", "--quiet", "--python", python,
             "--index-strategy", "unsafe-best-match", *requirements],
        ]  # fmt: skip
    else:
        variables = {}
        pip = [python, "-P", "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        commands = [[sys.executable, "-P", "-m", "venv", str(folder)], [*pip, *requirements]]
    began = time.monotonic()
    for command in commands:
        _run(command, variables, lambda: tell(progress(folder, time.monotonic() - began)))


def progress(folder: Path, seconds: float) -> str:
    """How far the making of an environment has come."""
    return f"\r{folder.name}: {size_mb(folder):.0f} MB, {seconds:.0f} s "


def size_mb(folder: Path) -> float:
    """What a folder holds [MB]."""
    sizes = 0
    for place, _, names in os.walk(folder):
        for name in names:
            try:
                sizes += os.lstat(os.path.join(place, name)).st_size
            except OSError:  # gone while we looked
                continue
    return sizes / 1e6


def _run(command: Sequence[str], variables: Mapping[str, str], look: Callable[[], None]) -> None:
    process = subprocess.Popen(
        command,
        env={**os.environ, **variables},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
    )
    with process:
        try:
            while True:
                try:
                    said, _ = process.communicate(timeout=LOOK_PERIOD)
                    break
                except subprocess.TimeoutExpired:
                    look()
        except BaseException:
            process.kill()
            raise
    if process.returncode:
        reason = " ".join(said.split())[-600:]
        raise SimulatorError(f"{' '.join(command)} failed: {reason}")


def _as_uv(configuration: Mapping[str, str]) -> dict[str, str]:
    """pip's configuration in uv's variables, but for those that the user has set."""
    found = {}
    for option, variable in UV_VARIABLES.items():
        if option in configuration and variable not in os.environ:
            separator = "," if option == "find-links" else " "
            found[variable] = separator.join(configuration[option].split())
    return found
